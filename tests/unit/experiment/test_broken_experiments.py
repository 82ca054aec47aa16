"""Every way of writing a wrong experiment file gets one readable message at the right place, marked § in the text."""

# ruff: noqa: E501  (one case, one line)

from __future__ import annotations

import math
from pathlib import Path

import pytest
from helpers.experiment_files import GOOD, POSITION, broken_file, problems_of

from hilrig.core.errors import ExperimentError, HilrigError
from hilrig.core.parameters import Parameter
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.experiment.schema.values import numeric_form, read_number

CSV = "{kind: csv, file: §curve.csv, column: x}"

# (what is replaced, by what, words of the message)
BROKEN: dict[str, tuple[str, str, tuple[str, ...]]] = {
    # the text is no YAML, or more than YAML 1.2 for plain data
    "unclosed list": ("[z]", "[z\n", ("is not YAML", "flow sequence")),
    "tab": ("  kind: two_link", "§\tkind: two_link", ("is not YAML", "\\t")),
    "second document": ("controllers:", "§---\ncontrollers:", ("is not YAML", "single document")),
    "duplicate key": ("period: 1 ms", "period: 1 ms\n§period: 2 ms", ("'period'", "twice", "line 4")),
    "undefined alias": ("{kind: pd}", "§*nothing", ("undefined alias", "nothing")),
    "cyclic anchor": ("[z]", "§&a [*a]", ("contains itself",)),
    "custom tag": ("{kind: pd}", "§!pd {}", ("tag !pd", "plain data")),
    "python tag": ("1 ms", "§!!python/object:os.system x", ("tag", "plain data")),
    "merge key": ("{kind: pd}", "{§<<: {kind: pd}}", ("merge keys", "<<")),
    "key that is a list": ("{kind: pd}", "{kind: pd, §[a]: 1}", ("a key must be a name",)),
    # timing budget
    "age that no command can have": ("controllers:", "timing: {command_age_p99: §0.9 ms}\ncontrollers:", ("0.9 ms cannot be kept", "a period of 1 ms", "allow more than that")),
    "share of late ticks": ("controllers:", "timing: {late_fraction: §150 %}\ncontrollers:", ("'150 %' is not allowed", "from 0 to 1")),
    "share with a unit": ("controllers:", "timing: {late_fraction: §1 ms}\ncontrollers:", ("'1 ms' is a time", "a pure number")),
    "unknown budget": ("controllers:", "timing: {§late_fracton: 1 %}\ncontrollers:", ("'late_fracton'", "did you mean 'late_fraction'")),
    # safety
    "torque beyond the robot's": ("controllers:", "safety: {torque: §[500 N*m, 20]}\ncontrollers:", ("500 N m is more than the robot's own limit of joint 1, 200 N m",)),
    "a torque too many": ("controllers:", "safety: {torque_rate: §[1, 2, 3]}\ncontrollers:", ("3 values given; this needs 1 or 2 (joints: 2)",)),
    "workspace of no axis": ("controllers:", "safety: {workspace: {§y: [0, 1]}}\ncontrollers:", ("the robot has no axis 'y'", "axes: x, z")),
    "workspace upside down": ("controllers:", "safety: {workspace: {z: §[0.5 m, 0.1 m]}}\ncontrollers:", ("[0.5, 0.1] is no range", "the lowest and the highest")),
    "workspace with one end": ("controllers:", "safety: {workspace: {z: §[0.5 m]}}\ncontrollers:", ("[0.5] is no range",)),
    "margin that leaves nothing": ("controllers:", "safety: {joint_margin: §4 rad}\ncontrollers:", ("leaves joint 1 nowhere to be",)),
    "trip on what is not commanded": ("controllers:", "safety: {trip_on: §[position]}\ncontrollers:", ("this driver takes torques",)),
    "trip on no limit": ("controllers:", "safety: {trip_on: [§speed]}\ncontrollers:", ("'speed' is not allowed", "'torque_rate'")),
    "law without memory": ("controllers:", "rig: {law_memory: §1 MB}\ncontrollers:", ("1 MB", "not allowed")),
    # keys
    "unknown key": ("period:", "§perod:", ("'perod'", "did you mean 'period'", "allowed", "repeats")),
    "unknown parameter": ("{kind: pd}", "{kind: pd, §stifness: 3}", ("'stifness'", "'stiffness'", "damping")),
    "unknown nested key": ("stiffness: 800", "§stifness: 800", ("'stifness'", "did you mean 'stiffness'")),
    "unknown task key": ("  force_axes: [z]", "  force_axes: [z]\n  §force_axis: z", ("'force_axis'", "'force_axes'")),
    "missing version": ("hilrig: 1\n", "", ("'hilrig' is missing", "version")),
    "missing question": ("question: What is wrong?\n", "", ("'question' is missing",)),
    "missing duration": ("- name: first\n    duration: 4 s", "- §name: first", ("'duration' is missing",)),
    "missing parameter": (POSITION, "§{kind: sine, amplitude: 0.1 m}", ("'frequency' is missing",)),
    "missing robot": ("  robot: {kind", "  # robot: {kind", ("'robot' is missing",)),
    # kinds
    "unknown kind": ("{kind: pd}", "{kind: §pdd}", ("'pdd'", "did you mean 'pd'", "adaptive")),
    "unknown driver": ("kind: two_link", "kind: §two_lnk", ("'two_lnk'", "did you mean 'two_link'")),
    "kind missing": ("{kind: pd}", "§{stiffness: 3}", ("'kind' is missing", "adaptive")),
    "kind is a number": ("{kind: pd}", "{kind: §3}", ("3 is not a kind",)),
    "kind of another group": ("{kind: pd}", "{kind: §sine}", ("'sine'", "controllers", "adaptive")),
    "controller is a text": ("pd: {kind: pd}", "pd: §pd", ("'pd' is not a mapping with 'kind', such as {kind: pd}",)),
    "file that is not there": ("{kind: pd}", "{kind: §./nothing.py}", ("nothing.py", "cannot be read")),
    # numbers at the edge
    "too large a float": ("position: 0.35 m", "position: §1e400", ("1e400 is not a finite number",)),
    "too large a whole number": ("duration: 4 s", "duration: §1" + 400 * "0", ("of 401 digits is not a finite number",)),
    "more digits than are read": ("duration: 4 s", "duration: §1" + 5000 * "0", ("has 5001 digits, too many",)),
    "too large a hexadecimal number": ("period: 1 ms", "repeats: §0x" + 9000 * "f", ("digits is not allowed", "from 1")),
    "seed beyond 64 bits": ("period: 1 ms", "seed: §0x8000000000000000", ("0x8000000000000000 is not allowed",)),
    "infinite limit": ("period: 1 ms", "expect: [{metric: effort, controller: pd, below: §.inf}]", (".inf is not a finite",)),
    "limit that is NaN": ("period: 1 ms", "expect: [{metric: effort, controller: pd, below: §.nan}]", (".nan is not",)),
    "infinite start": ("[z]", "[z]\n  start: {x: §.inf}", (".inf is not a finite number",)),
    "infinity in a list": ("lengths: [0.345 m, 0.2 m]", "lengths: §[0.345 m, .inf]", ("inf is not a finite number",)),
    "beyond its bound in another unit": ("period: 1 ms", "period: §99.9 us", ("'99.9 us' is not allowed", "from 0.0001")),
    "no time to sleep in": ("period: 1 ms", "clock: realtime\nperiod: §0.1 ms", ("no time to sleep", "'rig.spin'", "0.0001 s")),
    "spin as long as the period": (
        "period: 1 ms", "clock: realtime\nrig: {spin: §2 ms}", ("'rig.spin'", "is 0.002 s; set it to less than the period"),
    ),
    "half a character": ("What is wrong?", '§"\\ud800"', ("half of a surrogate pair",)),
    "a key in two spellings": ("period: 1 ms", "period: 1 ms\n§perio\uff44: 2 ms", ("'perio\uff44' appears twice",)),
    "number for a text": ("name: broken", "name: §2026", ("2026 is not text; put it in quotes",)),
    # values
    "wrong version": ("hilrig: 1", "hilrig: §2", ("2 is not allowed", "allowed: 1")),
    "wrong dimension": ("period: 1 ms", "period: §3 kg", ("'3 kg' is a mass", "a time", "1 ms")),
    "force for a position": ("amplitude: 0.1 m", "amplitude: §0.1 N", ("'0.1 N' is a force", "a length")),
    "position for a force": ("value: 3.5 N", "value: §3.5 m", ("'3.5 m' is a length", "a force")),
    "unknown unit": ("duration: 4 s", "duration: §4 fortnight", ("'fortnight' is not a unit", "kg")),
    "no quantity": ("duration: 4 s", "duration: §long", ("'long' is not a quantity", "a time")),
    "boolean for a quantity": ("duration: 4 s", "duration: §true", ("true is not a quantity",)),
    "not a number": ("position: 0.35 m", "position: §.nan", (".nan is not a finite number",)),
    "infinite": ("position: 0.35 m", "position: §-.inf", ("-.inf is not a finite number",)),
    "too large to be finite": ("position: 0.35 m", "position: §1e999 m", ("not a finite number",)),
    "negative duration": ("duration: 4 s", "duration: §-4 s", ("'-4 s' is not allowed", "from 0.0001")),
    "zero duration": ("duration: 4 s", "duration: §0", ("0 is not allowed", "a time")),
    "period as written": ("period: 1 ms", "period: §1e-9", ("1e-9 is not allowed", "from 0.0001 to 0.1 s")),
    "no whole number of periods": ("duration: 4 s", "duration: §4.0005 s", ("4.0005", "whole number of periods")),
    "negative stiffness": ("800 N/m", "§-800 N/m", ("'-800 N/m' is not allowed", "a stiffness", "0 to 1e+07 N/m")),
    "null": ("duration: 4 s", "duration: §~", ("nothing is not a quantity",)),
    "too few lengths": ("[0.345 m, 0.2 m]", "§[0.345 m]", ("a list of 1", "a list of 2")),
    "one length": ("[0.345 m, 0.2 m]", "§0.345 m", ("'0.345 m' is one value", "a list of 2")),
    "list for a number": ("duration: 4 s", "duration: §[4 s]", ("a list of 1 is not one value",)),
    "too many axes": ("inertia: [3, 6]", "inertia: §[3, 6, 9]", ("3 values", "2", "x, z")),
    "text for a list": ("[z]", "§z", ("'z' is not a list",)),
    "repeats not whole": ("period: 1 ms", "repeats: §1.5", ("1.5 is not a whole number", "from 1")),
    "no repeats": ("period: 1 ms", "repeats: §0", ("0 is not allowed", "from 1")),
    "unknown choice": ("stiffness: [250, 0]", "stiffness: [250, 0], states: §mesured", ("'mesured'", "'measured'")),
    "unknown clock": ("period: 1 ms", "clock: §real_time", ("'real_time'", "did you mean 'realtime'", "lockstep")),
    "text for a switch": ("stiffness: 800 N/m", "stiffness: 800, pulls: §yes", ("'yes' is not true or false",)),
    "task is a list": ("task:\n", "task: §[]\nignored:\n", ("a list of 0 is not a mapping",)),
    "name is a path": ("name: broken", "name: §../broken", ("'../broken' cannot be a name", "A-Z, a-z")),
    "points that do not rise": (
        POSITION, "§{kind: waypoints, times: [0, 2, 1], values: [0, 0, 0]}", ("must rise", "1 s follows 2 s"),
    ),
    "points that do not match": (
        POSITION, "§{kind: waypoints, times: [0, 2], values: [0]}", ("2 times, but 1 values",),
    ),
    "CSV that is not there": (POSITION, "{kind: csv, file: §none.csv, column: x}", ("none.csv", "cannot be read")),
    "CSV without the column": (POSITION, "{kind: csv, file: §curve.csv, column: xx}", ("'xx'", "columns: time, x")),
    "CSV with a gap": (POSITION, "{kind: csv, file: §curve.csv, column: gap}", ("curve.csv: line 3, column 'gap'", "empty")),
    "CSV with NaN": (POSITION, "{kind: csv, file: §curve.csv, column: nan}", ("curve.csv: line 3, column 'nan'", "finite")),
    "CSV whose time falls": (POSITION, "{kind: csv, file: §curve.csv, column: x, time: back}", ("must rise",)),
    # what does not fit together
    "no controllers": ("  pd: {kind: pd}", "  §{}", ("no controllers", "at least one")),
    "no phases": (GOOD[GOOD.index("phases:") : GOOD.index("conditions:")], "phases: §[]\n", ("no phases",)),
    "no conditions": ("conditions:\n  noisy: [{kind: sensor_noise, force: 0.05 N}]", "conditions: §{}", ("no conditions",)),
    "names that differ in case": ("  pd: {kind: pd}", "  pd: {kind: pd}\n  §PD: {kind: pd}", ("'PD'", "'pd'", "taken")),
    "phase called all": ("name: first", "name: §all", ("'all' stands for all phases",)),
    "unknown force axis": ("[z]", "[§y]", ("no axis 'y'", "axes: x, z")),
    "force axis twice": ("[z]", "[z, §z]", ("'z' is listed twice",)),
    "reference missing": (f"\n    position: {POSITION}", "", ("'position' is missing", "'x'")),
    "reference for a wrong axis": (POSITION, "{§z: {kind: hold, value: 0}}", ("'z' is not position-controlled", "x")),
    "which axis": ("[z]\n", "[]\n", ("which axis", "x, z")),
    "force without force axis": ("{kind: hold, value: 3.5 N}", "{z: {kind: hold, value: 1}, §x: {kind: hold, value: 1}}", ("'x' is not force-controlled",)),
    "real time without delay": ("period: 1 ms", "clock: realtime\nactuation_delay: §0", ("0", "lockstep", "1 to 10")),
    "disturbed axis": (
        "{kind: sensor_noise, force: 0.05 N}", "§{kind: force_sine, amplitude: 1, frequency: 1, axis: y}",
        ("no axis 'y'", "x, z"),
    ),
    "disturbance that ends first": (
        "{kind: sensor_noise, force: 0.05 N}", "§{kind: stiffness_step, factor: 2, at: 3 s, until: 2 s}",
        ("until: 2 s", "at: 3 s"),
    ),
    "delay given twice": (
        "{kind: sensor_noise, force: 0.05 N}", "§{kind: measurement_delay, ticks: 1, delay: 1 ms}", ("'ticks' or 'delay'",),
    ),
    "expected of nobody": (
        "period: 1 ms", "expect: [{metric: force_rmse, controller: §pdd, below: 1 N}]", ("'pdd'", "'pd'"),
    ),
    "expected less nobody": (
        "period: 1 ms", "expect: [{metric: force_rmse, controller: pd, minus: §pdd, below: 1 N}]",
        ("no controller 'pdd'", "did you mean 'pd'"),
    ),
    "expected less itself": (
        "period: 1 ms", "expect: [{metric: force_rmse, controller: pd, minus: §pd, below: 1 N}]",
        ("'pd' minus itself is always zero", "others: none"),
    ),
    "expected metric unknown": (
        "period: 1 ms", "expect: [{metric: §force_rms, controller: pd, below: 1 N}]", ("'force_rms'", "'force_rmse'"),
    ),
    "expected in no phase": (
        "period: 1 ms", "expect: [{metric: force_rmse, controller: pd, phase: §frist, below: 1 N}]", ("'frist'", "'first'"),
    ),
    "expected in a wrong unit": (
        "period: 1 ms", "expect: [{metric: force_rmse, controller: pd, below: §1 m}]", ("'1 m' is a length", "a force"),
    ),
    "nothing expected": ("period: 1 ms", "expect: [§{metric: force_rmse, controller: pd}]", ("'below' or 'above'",)),
    "nothing expected at all": ("period: 1 ms", "expect: [§{controller: pd}]", ("nothing is expected", "'metric'", "or 'outcome'")),
    "expected end and metric": (
        "period: 1 ms", "expect: [{metric: force_rmse, controller: pd, §outcome: tripped, below: 1 N}]", ("both given",),
    ),
    "expected end of a kind unknown": (
        "period: 1 ms", "expect: [{controller: pd, outcome: §triped}]", ("'triped'", "did you mean 'tripped'", "completed"),
    ),
    "expected end that is a fault": ("period: 1 ms", "expect: [{controller: pd, outcome: §failed}]", ("not allowed", "completed")),
    "expected end of a phase": (
        "period: 1 ms", "expect: [{controller: pd, outcome: tripped, §phase: all}]", ("'phase' does not go with 'outcome'",),
    ),
    "expected end along an axis": (
        "period: 1 ms", "expect: [{controller: pd, outcome: tripped, §axis: z}]", ("'axis' does not go with 'outcome'",),
    ),
    "expected end with a limit": (
        "period: 1 ms", "expect: [{controller: pd, outcome: tripped, §below: 1 N}]", ("'below' does not go with 'outcome'",),
    ),
    "expected end less another": (
        "period: 1 ms", "expect: [{controller: pd, outcome: tripped, §minus: pd}]", ("'minus' does not go with 'outcome'",),
    ),
    "expected end of nobody": ("period: 1 ms", "expect: [{controller: §pdd, outcome: tripped}]", ("'pdd'", "'pd'")),
    "expected end in no condition": (
        "period: 1 ms", "expect: [{controller: pd, outcome: tripped, condition: §noise}]", ("'noise'", "'noisy'"),
    ),
    # what only the plan finds
    "out of reach": (
        "amplitude: 0.1 m", "amplitude: 0.6 m", ("phase 'first'", "t = 0.", "x = 0.4", "z = 0.35 m", "out of reach"),
    ),
    "joint limit": (
        "masses: [1.8 kg, 1.1 kg]", "masses: [1.8 kg, 1.1 kg], joint_upper: [0.5, 3]", ("needs joint 1", "to 0.5 rad"),
    ),
    "surface out of reach": ("position: 0.35 m", "position: 0.6 m", ("t = 0 s", "out of reach", "0.545 m")),
    "start out of reach": ("[z]", "[z]\n  start: §{x: 3 m}", ("the start", "x = 3 m", "out of reach")),
    "start of an unknown axis": ("[z]", "[z]\n  start: {§y: 3 m}", ("no axis 'y'",)),
    "move from nowhere": (POSITION, "§{kind: min_jerk, end: 0.1 m}", ("needs 'start'", "phase 'first'")),
    "move that is too long": (
        POSITION, "§{kind: min_jerk, start: 0, end: 0.1 m, duration: 9 s}", ("9 s", "lasts 4 s"),
    ),
    "gains for three axes": ("{kind: pd}", "§{kind: pd, stiffness: [1, 2, 3]}", ("3 values", "2")),
    "too many ticks": ("duration: 4 s", "duration: 10000 s", ("10000000 ticks", "5000000")),
}  # fmt: skip


def test_the_good_file_is_good(tmp_path: Path) -> None:
    path, _ = broken_file(tmp_path, GOOD)
    assert [trial.id for trial in plan(load(path))] == ["pd.noisy.0"]


@pytest.mark.parametrize(("old", "new", "words"), BROKEN.values(), ids=BROKEN)
def test_message_and_place(tmp_path: Path, old: str, new: str, words: tuple[str, ...]) -> None:
    assert old in GOOD
    path, place = broken_file(tmp_path, GOOD.replace(old, new, 1))
    message, error = problems_of(path)
    for word in words:
        assert word in message
    for problem in error.problems:
        assert "\n" not in problem.message
        assert problem.place is not None
        assert problem.place.file == str(path)
    if place is not None:
        assert place in [problem.place[1:] for problem in error.problems if problem.place]
    assert sorted(item.name for item in tmp_path.iterdir()) == ["broken.yaml", "curve.csv"]


WHOLE_FILES = {
    "empty": (b"", "empty"),
    "a list": (b"- 1\n", "a list"),
    "a word": (b"hello\n", "a single value"),
    "binary": (b"name: \xff\xfe\n", "1:7: is not UTF-8 text: byte 0xff"),
    "control character": (b"name: a\x00b\n", "1:8: is not YAML"),
    "huge": (b"#" * (1 << 20) + b"\n", "larger than 1 MiB"),
    "deep": (b"[" * 5_000, "nested too deeply"),
    "not YAML at all": (b"<html><body class='x'>: [</body></html>", "is not YAML"),
    "exploding aliases": (
        b"a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
        + b"".join(b"%c: &%c [%s]\n" % (i + 1, i + 1, b", ".join([b"*%c" % i] * 10)) for i in range(97, 103)),
        "expand to more than 100000 values",
    ),
}


@pytest.mark.parametrize(("content", "words"), WHOLE_FILES.values(), ids=WHOLE_FILES)
def test_files_that_are_no_experiment(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "broken.yaml"
    path.write_bytes(content)
    message, error = problems_of(path)
    assert words in message
    assert len(error.problems) == 1


@pytest.mark.parametrize("text", ["claims: []\n", "hilrig: 1\ntitle: T\nexperiments: [a.yaml]\n"])
def test_a_study_is_told_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "my study.yaml"
    path.write_text(text)
    with pytest.raises(ExperimentError) as caught:
        load(path, ["repeats=2"])
    assert str(caught.value) == f"{path}: this is a study, not an experiment; type: hilrig reproduce '{path}'"


def test_an_experiment_with_a_key_of_a_study_is_still_an_experiment(tmp_path: Path) -> None:
    path, _ = broken_file(tmp_path, GOOD + "claims: []\n")
    assert "unknown key 'claims'" in problems_of(path)[0]


def test_missing_file_and_directory(tmp_path: Path) -> None:
    with pytest.raises(HilrigError, match="there is no such file"):
        load(tmp_path / "none.yaml")
    with pytest.raises(HilrigError, match="is a directory"):
        load(tmp_path)


def test_all_problems_are_reported_together_in_the_order_of_the_file(tmp_path: Path) -> None:
    text = GOOD.replace("1 ms", "3 kg").replace("duration: 4 s", "duration: -1").replace("{kind: pd}", "{kind: pdd}")
    path, _ = broken_file(tmp_path, text)
    _, error = problems_of(path)
    assert [problem.place.line for problem in error.problems if problem.place] == [4, 14, 20]


def test_a_driver_that_lacks_an_ability_is_refused(tmp_path: Path) -> None:
    (tmp_path / "driver.py").write_text(FIXED_SURFACE_DRIVER)
    text = GOOD.replace("kind: two_link", "kind: ./driver.py").replace(
        "{kind: sensor_noise, force: 0.05 N}", "§{kind: surface_motion, amplitude: 1 mm, frequency: 1 Hz}"
    )
    text = text.replace("period: 1 ms", "clock: realtime")
    path, place = broken_file(tmp_path, text)
    message, error = problems_of(path)
    assert "cannot apply 'surface_motion'" in message
    assert "plant_tip_force" in message
    assert "cannot run with the clock 'realtime'" in message
    assert place in [problem.place[1:] for problem in error.problems if problem.place]


FIXED_SURFACE_DRIVER = '''
from dataclasses import dataclass
from typing import ClassVar
from hilrig.kinds.contact import Surface
from hilrig.core.interfaces import Capabilities
from hilrig.kinds.robots.planar_2r import Planar2r

@dataclass(frozen=True)
class Fixed:
    """A driver whose surface cannot move."""

    capabilities: ClassVar[Capabilities] = Capabilities(("lockstep",), ("plant_tip_force",), True)
    robot: Planar2r
    surface: Surface
    servo_gain: ClassVar = None

    @property
    def surface_position(self):
        return self.surface.position

    def connect(self, start):
        raise NotImplementedError
'''


@pytest.mark.parametrize(("name", "words"), [("/dev/zero", "is not a regular file"), ('"a\\0"', "is not a path")])
def test_a_table_that_need_not_end_is_not_read(tmp_path: Path, name: str, words: str) -> None:
    path, _ = broken_file(tmp_path, GOOD.replace(POSITION, f"{{kind: csv, file: {name}, column: x}}"))
    assert words in problems_of(path)[0]


@pytest.mark.parametrize("period", ["100 us", "100 μs", "0.1 ms", "1e-4", "0.0001 s", "1e5 ns"])
def test_the_least_period_can_be_had_in_any_unit(tmp_path: Path, period: str) -> None:
    path, _ = broken_file(tmp_path, GOOD.replace("1 ms", period))
    assert load(path).period == 1e-4


BOUNDS = {"180 deg": math.pi, "60 deg": math.pi / 3, "135 deg": 3 * math.pi / 4, "1 turn": 2 * math.pi}


@pytest.mark.parametrize(("angle", "bound"), BOUNDS.items())
def test_a_bound_that_was_worked_out_can_be_had(angle: str, bound: float) -> None:
    form = numeric_form(float)
    assert form is not None
    assert read_number(angle, form, Parameter("rad", "", bound, 10.0)) == bound
    assert read_number(angle, form, Parameter("rad", "", 0.0, bound)) == bound
