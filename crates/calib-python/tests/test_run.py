"""`calib.run`: the program's report, progress, interrupts and errors."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import calib
import pytest
from conftest import Program


@pytest.mark.parametrize("robot", ["ripley", "justin"])
def test_the_files_are_those_of_the_program(
    robot: str, program: Program, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    report: calib.Report = request.getfixturevalue(robot)
    done = program("run", f"robots/{robot}.yaml", "--out", tmp_path)
    assert done.returncode == report.exit_code == 0, done.stderr
    assert report.json.encode() == (tmp_path / "report.json").read_bytes()
    for name, content in report.files.items():
        assert content == (tmp_path / name).read_bytes(), name


def test_attributes_are_those_of_the_report(ripley: calib.Report) -> None:
    assert ripley.verdict == "accepted" and ripley.robot == ripley.data["robot"]
    assert ripley.parameters[0].name == ripley.data["parameters"][0]["name"]
    assert ripley.verification.held_out.calibrated.rms_m < 1e-3
    assert "parameters" in dir(ripley)
    with pytest.raises(AttributeError, match="there is no verdikt"):
        ripley.verdikt
    assert repr(ripley) == "Report('ripley': accepted)"


def test_a_notebook_shows_the_page(ripley: calib.Report) -> None:
    page = ripley._repr_html_()
    assert page.startswith("<iframe srcdoc=") and page.endswith("</iframe>")
    assert "&lt;!DOCTYPE html&gt;" in page[:300] or "&lt;!doctype html&gt;" in page[:300]


def test_figures_are_files_of_their_own(ripley: calib.Report) -> None:
    figures = ripley.figures
    assert len(figures) > 3
    for name, figure in figures.items():
        root = ElementTree.fromstring(figure.svg)
        assert root.tag == "{http://www.w3.org/2000/svg}svg", name
        inside = {child.tag.rpartition("}")[2] for child in root}
        assert {"title", "desc", "style", "path"} <= inside | {"path"}, name
        assert figure.title and figure.description and figure._repr_svg_() == figure.svg


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_tables(ripley: calib.Report, library: str) -> None:
    pytest.importorskip(library)
    frame = getattr(ripley, f"to_{library}")
    parameters, residuals, held_out = frame(), frame("residuals"), frame("held_out")
    assert len(parameters) == len(ripley.parameters)
    assert {"name", "value", "sigma"} <= set(parameters.columns)
    # Every sample of the fit; the report counts those that were used.
    assert int(residuals["used"].sum()) == ripley.data["residuals"]["all"]["samples"]
    rms = float((residuals["norm_m"][residuals["used"]] ** 2).mean() ** 0.5) if library == "pandas" else None
    if rms is not None:
        assert rms == pytest.approx(ripley.data["residuals"]["all"]["rms_m"], rel=1e-6)
    assert len(held_out) == ripley.verification.held_out.n
    assert "waist_rad" in held_out.columns


def test_stages_are_told_and_an_exception_stops() -> None:
    stages: list[str] = []
    calib.run("robots/ripley.yaml", method="paper", progress=stages.append)
    assert stages[:2] == ["read profile and robot", "read recordings"]
    assert stages[-1] == "write results"

    def stop(stage: str) -> None:
        if stage == "check data":
            raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        calib.run("robots/ripley.yaml", progress=stop)


def test_files_are_written_where_a_folder_is_named(tmp_path: Path) -> None:
    report = calib.run("robots/ripley.yaml", method="paper", out=tmp_path / "here")
    assert (tmp_path / "here/report.json").read_bytes() == report.files["report.json"]


def test_errors_say_what_the_program_says(program: Program, tmp_path: Path) -> None:
    profile = tmp_path / "wrong.yaml"
    text = Path("robots/ripley.yaml").read_text()
    profile.write_text(text.replace("robot:", "robbot:", 1))
    done = program("run", profile, "--out", tmp_path / "out")
    with pytest.raises(calib.CalibError) as raised:
        calib.run(profile)
    assert done.stderr.strip() == f"error: {raised.value}"
    assert done.returncode == raised.value.exit_code == 2
    with pytest.raises(calib.CalibError, match="cannot be read|cannot be opened|No such file"):
        calib.run(tmp_path / "none.yaml")


def is_idle() -> bool:
    """Whether this process calculates nothing for 20 ms. Threads are not counted: packages of other tests start some that stay."""
    before = time.process_time()
    time.sleep(0.02)
    return time.process_time() - before < 0.005


@pytest.fixture(scope="module")
def selection_s() -> float:
    """How long a selection takes on this machine, which fits many models: the shorter of two."""

    def once() -> float:
        started = time.monotonic()
        calib.run("robots/ripley.yaml", select=True)
        return time.monotonic() - started

    return min(once(), once())


@pytest.fixture
def heard_interrupts() -> Iterator[None]:
    """Python raises an interrupt as in a terminal: what a shell starts in the background ignores it from birth."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard_interrupts")
@pytest.mark.parametrize("part", [0.05, 0.2, 0.35, 0.5, 0.6])
def test_an_interrupt_is_answered_within_100_ms(
    part: float, selection_s: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    after = part * selection_s
    calib.run("robots/ripley.yaml", method="paper")  # The pool of threads is there from now on.
    time.sleep(0.2)  # The thread of that run is gone.
    sent: list[float] = []

    def interrupt() -> None:
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after, interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        calib.run("robots/ripley.yaml", select=True, out=tmp_path / "out")
    answered = time.monotonic() - sent[0]
    timer.join()
    while not is_idle() and time.monotonic() - sent[0] < 10:
        pass
    ended = time.monotonic() - sent[0]
    with capsys.disabled():
        print(f"\ninterrupted after {after:.2f} s: answered in {answered * 1e3:.0f} ms, computation ended in {ended * 1e3:.0f} ms")
    assert answered < 0.1
    assert ended < 10
    left = [p.name for p in tmp_path.rglob("*") if p.suffix in (".json", ".html", ".urdf")]
    assert not left, "nothing of an interrupted run is written"
