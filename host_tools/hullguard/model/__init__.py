"""Reading and checking model files."""

from hullguard.model.faults import FaultSpec, parse_fault
from hullguard.model.schema import Model, find_model, load_model, parse_override

__all__ = ["FaultSpec", "Model", "find_model", "load_model", "parse_fault", "parse_override"]
