"""peers_fetch.py FOLDER DBC: C sources of other libraries, from where package registries have them, into FOLDER. Exit status 3: they cannot be had.

cmsis/    CMSIS-DSP, as its Python package brings it
ikalman/  a Kalman filter, with float for double: compared on processors that have no more
frame/    pack and unpack of the DBC's messages, by cantools, and CRC-8 with polynomial 0x2F, by pycrc
"""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

LIST = Path(__file__).with_name("peers.txt")
CRC = ["--width", "8", "--poly", "0x2f", "--reflect-in", "False", "--xor-in", "0xff", "--reflect-out", "False", "--xor-out", "0xff"]
CRC += ["--algorithm", "table-driven", "--symbol-prefix", "crc8_"]
TIMEOUT_S = 240.0


def there(folder: Path) -> bool:
    """Whether all has been fetched before."""
    wanted = set(re.findall(r"sha256:(\w+)", LIST.read_text(encoding="utf-8")))
    return wanted <= {hashlib.sha256(file.read_bytes()).hexdigest() for file in folder.iterdir() if file.is_file()}


def fetched(folder: Path) -> bool:
    """Ask the registry, and say when it does not answer."""
    if there(folder):
        return True
    command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--no-binary", "cmsisdsp,ikalman", "--require-hashes", "-r", str(LIST), "-d", str(folder)]
    try:
        ran = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
        why = (ran.stderr.strip().splitlines() or [""])[-1] if ran.returncode else ""
    except subprocess.TimeoutExpired:
        why = f"no answer within {TIMEOUT_S:g} s"
    if why:
        print(f"no other libraries are compared: their sources cannot be fetched from the package registry ({why})")
    return not why


def unpack(folder: Path, name: str, to: str) -> None:
    """A source archive without its outermost folder."""
    (archive,) = folder.glob(f"{name}-*.tar.gz")
    with tarfile.open(archive) as tar:
        tar.extractall(folder / "unpacked", filter="data")
    shutil.rmtree(folder / to, ignore_errors=True)
    (folder / "unpacked" / archive.name.removesuffix(".tar.gz")).rename(folder / to)


def generate(folder: Path, dbc: Path) -> None:
    """The frame codec and the checksum."""
    out = folder / "frame"
    out.mkdir(exist_ok=True)
    subprocess.run(
        [sys.executable, "-m", "cantools", "generate_c_source", "--no-floating-point-numbers", "-o", str(out), "--database-name", "peer", str(dbc)],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    (wheel,) = folder.glob("pycrc-*.whl")
    for kind in "ch":
        command = [sys.executable, "-m", "pycrc", *CRC, "--generate", kind, "-o", str(out / f"crc8.{kind}")]
        subprocess.run(command, check=True, env={"PYTHONPATH": str(wheel)})


def main() -> int:
    """All of it."""
    folder, dbc = Path(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    if not fetched(folder):
        return 3
    unpack(folder, "cmsisdsp", "cmsis")
    unpack(folder, "ikalman", "ikalman")
    for source in (folder / "ikalman").glob("*.[ch]"):
        source.write_text(re.sub(r"\bdouble\b", "float", source.read_text(encoding="utf-8")), encoding="utf-8")
    generate(folder, dbc)
    return 0


if __name__ == "__main__":
    sys.exit(main())
