"""Faults on a CAN bus, as composable directives with a ledger of what was done."""

from hullguard.inject.codec import Codec, codec_of, design_codec, read_codec
from hullguard.inject.directive import Directive, parse_directive, read_directives
from hullguard.inject.engine import Injector, Sent
from hullguard.inject.labels import Label, Ledger

__all__ = ["Codec", "Directive", "Injector", "Label", "Ledger", "Sent", "codec_of", "design_codec", "parse_directive", "read_codec", "read_directives"]
