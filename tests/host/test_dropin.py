"""The library in builds of others: two files, C++, CMake, Zephyr, Arduino; and the integration that the manual prints."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from host_support import REALS, ROOT, Cli

WARN = "-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wshadow -Wundef -Wmissing-prototypes -Werror -ffp-contract=off".split()
COMPILERS = {"gcc": ["gcc"], "clang": ["clang-19"], "arm": ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb"]}
EXAMPLES = ROOT / "firmware" / "examples"
DRIVER = Path(__file__).with_name("drive_frames.c")


def compile_c(command: list[str], *files: str | Path, out: Path, options: tuple[str, ...] = ()) -> None:
    done = subprocess.run([*command, *options, "-o", str(out), *map(str, files)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:4000]


@pytest.fixture(scope="module")
def amalgam(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folders with hullguard.h and hullguard.c: of one model and of two."""
    made = {}
    for models in (("platoon",), ("platoon", "platoon_bank")):
        out = tmp_path_factory.mktemp("amalgam")
        done = subprocess.run([ROOT / ".venv" / "bin" / "python", "-m", "hullguard", "amalgam", *models, "--out", out, "-q"], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        made["+".join(models)] = out
    return made


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("real", REALS)
def test_the_amalgam_compiles_without_a_warning(amalgam: dict[str, Path], tmp_path: Path, compiler: str, real: str) -> None:
    options = ("-std=c11", "-O1", "-c", f"-DHG_REAL_{real.upper()}=1", *WARN)
    for folder in amalgam.values():
        compile_c(COMPILERS[compiler], folder / "hullguard.c", out=tmp_path / "o", options=options)


def test_the_amalgam_leaves_out_what_the_model_does_not_call(amalgam: dict[str, Path]) -> None:
    one, two = ((amalgam[name] / "hullguard.c").read_text() for name in ("platoon", "platoon+platoon_bank"))
    assert "hg_detector_step(" in one and "hg_fusion_" not in one and "hg_isolate_" not in one
    assert "hg_platoon_bank_config" in two and "hg_platoon_bank_config" not in one
    assert "#include" not in one.replace('#include "hullguard.h"', "")


def frames_of(log: Path) -> tuple[str, list[str]]:
    """Frames to a node, as drive_frames.c reads them, and those that it answered with."""
    lines = [line.split()[2].replace("#", " ") for line in log.read_text().splitlines()]
    own = ("130", "131")
    return "".join(f"{line}\n" for line in lines if not line.startswith(own)), [line for line in lines if line.startswith(own)]


@pytest.mark.parametrize("real", REALS)
def test_verdicts_are_those_of_the_library(amalgam: dict[str, Path], cli: Cli, tmp_path: Path, real: str) -> None:
    run = tmp_path / "run"
    assert cli("run", "platoon", "--bus", "inprocess", "--real", real, "--out", run, "-q").status == 0
    given, expected = frames_of(run / "run.log")
    assert expected
    number = f"-DHG_REAL_{real.upper()}=1"
    library = (f"-I{ROOT / 'firmware' / 'include'}", f"-I{ROOT / 'firmware' / 'models'}", number, *WARN)
    sources = [*(ROOT / "firmware" / "src").glob("*.c"), ROOT / "firmware" / "models" / "platoon.c"]
    compile_c(["gcc", "-O1"], DRIVER, *sources, out=tmp_path / "library", options=library)
    answers = {}
    for name, folder in amalgam.items():
        compile_c(["gcc", "-O1"], DRIVER, folder / "hullguard.c", out=tmp_path / name, options=("-DAMALGAM", f"-I{folder}", number, *WARN))
    for name in ("library", *amalgam):
        done = subprocess.run([tmp_path / name], input=given, capture_output=True, text=True, check=True)
        answers[name] = done.stdout.splitlines()
    assert all(a == answers["library"] for a in answers.values())
    assert answers["library"] == expected


# ---- examples ----


def test_the_bare_integration_is_forty_lines_and_compiles(amalgam: dict[str, Path], tmp_path: Path) -> None:
    source = EXAMPLES / "bare.c"
    code = [line for line in source.read_text().splitlines() if line.strip() and not line.strip().startswith("/*")]
    assert len(code) <= 40
    manual = (ROOT / "firmware" / "README.md").read_text(encoding="utf-8")
    assert source.read_text() in manual, "firmware/README.md shows another text than firmware/examples/bare.c"
    for command in COMPILERS.values():
        compile_c(command, source, out=tmp_path / "o", options=("-std=c11", "-c", f"-I{amalgam['platoon']}", *(w for w in WARN if w != "-Wmissing-prototypes")))


ARDUINO = """
#pragma once
#include <cstdint>
#include <cstddef>
enum { LED_BUILTIN = 13, OUTPUT = 1, HIGH = 1, LOW = 0 };
void pinMode(int pin, int mode); void digitalWrite(int pin, int level); unsigned long micros();
enum class CanBitRate { BR_500k = 500000 };
uint32_t CanStandardId(uint32_t id);
struct CanMsg {
    CanMsg() = default; CanMsg(uint32_t id, uint8_t length, const uint8_t *data);
    uint32_t getStandardId() const; bool isExtendedId() const; uint8_t data_length; uint8_t data[8];
};
struct Can { bool begin(CanBitRate rate); size_t available(); CanMsg read(); int write(const CanMsg &message); };
extern Can CAN;
"""


def test_the_sketch_is_cplusplus(amalgam: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "Arduino_CAN.h").write_text(ARDUINO)
    options = ("-x", "c++", "-std=c++11", "-c", f"-I{tmp_path}", f"-I{amalgam['platoon']}", "-Wall", "-Wextra", "-Werror", "-Wno-missing-field-initializers")
    compile_c(["g++"], EXAMPLES / "arduino_node" / "arduino_node.ino", out=tmp_path / "o", options=options)


@pytest.mark.parametrize("real", REALS)
def test_every_header_is_one_of_cplusplus(tmp_path: Path, real: str) -> None:
    """Each alone; and none leaves a function without C linkage."""
    folder = ROOT / "firmware" / "include"
    for header in sorted((folder / "hullguard").glob("*.h")):
        source = tmp_path / "one.cpp"
        source.write_text(f'#include "hullguard/{header.name}"\n')
        compile_c(["g++"], source, out=tmp_path / "o", options=("-std=c++11", "-fsyntax-only", f"-I{folder}", f"-DHG_REAL_{real.upper()}=1", "-Wall", "-Wextra", "-Werror"))
        text = header.read_text()
        assert 'extern "C"' in text or not re.search(r"^[a-z].*\bhg_\w+\([^;]*\);", text, re.MULTILINE), header.name


# ---- builds of others ----

MAIN = """#include "platoon.h"
#include "openacc.h"
int main(void)
{
    static hg_platoon_node one;
    static hg_openacc_node two;
    return ((hg_platoon_node_start(&one, HG_START_MOVING) == HG_OK) && (hg_openacc_node_start(&two, HG_START_MOVING) == HG_OK)) ? 0 : 1;
}
"""
CMAKE = """cmake_minimum_required(VERSION 3.16)
project(app C)
set(HULLGUARD_MODELS platoon openacc)
add_subdirectory({firmware} hullguard)
add_executable(app main.c)
target_link_libraries(app PRIVATE hullguard::hullguard)
"""
ZEPHYR = """cmake_minimum_required(VERSION 3.16)
project(app C)
set(CONFIG_HULLGUARD y)
set(CONFIG_HULLGUARD_CONFIG_HEADER "")
macro(zephyr_library_named name)
  add_library(${{name}} STATIC)
  set(library ${{name}})
endmacro()
macro(zephyr_library_sources)
  target_sources(${{library}} PRIVATE ${{ARGN}})
endmacro()
macro(zephyr_library_compile_options)
  target_compile_options(${{library}} PRIVATE ${{ARGN}})
endmacro()
macro(zephyr_include_directories)
  include_directories(${{ARGN}})
  target_include_directories(${{library}} PUBLIC ${{ARGN}})
endmacro()
macro(zephyr_compile_definitions)
  add_compile_definitions(${{ARGN}})
endmacro()
include({firmware}/zephyr/CMakeLists.txt)
add_executable(app main.c {firmware}/models/platoon.c {firmware}/models/openacc.c)
target_include_directories(app PRIVATE {firmware}/models)
target_link_libraries(app PRIVATE hullguard)
"""


@pytest.mark.parametrize("text", [CMAKE, ZEPHYR], ids=["cmake", "zephyr"])
def test_two_models_in_one_image_of_another_build(tmp_path: Path, text: str) -> None:
    if shutil.which("cmake") is None:
        pytest.fail("cmake is missing: tests/packages.txt names it")
    (tmp_path / "CMakeLists.txt").write_text(text.format(firmware=ROOT / "firmware"))
    (tmp_path / "main.c").write_text(MAIN)
    for command in (["cmake", "-S", tmp_path, "-B", tmp_path / "build"], ["cmake", "--build", tmp_path / "build", "-j", "2"], [tmp_path / "build" / "app"]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


def test_what_cmake_is_asked_wrongly_is_one_clear_line(tmp_path: Path) -> None:
    for wrong, says in (("-DHULLGUARD_REAL=F16", "choose F32, F64 or Q31"), ("-DHULLGUARD_MODELS=nosuch", "no nosuch.c")):
        done = subprocess.run(["cmake", wrong, "-S", ROOT / "firmware", "-B", tmp_path / wrong], capture_output=True, text=True, check=False)
        assert done.returncode != 0 and says in done.stderr


# ---- wrong input ----


def test_models_of_one_name_are_refused(cli: Cli, tmp_path: Path) -> None:
    for models, says in ((("platoon", "platoon"), "each needs a name of its own"), (("nosuch.toml",), "no such file")):
        done = cli("amalgam", *models, "--out", tmp_path)
        assert done.status == 2 and says in done.err
