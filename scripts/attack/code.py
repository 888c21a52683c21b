"""Other people's agents, controllers and worlds that are no use, as the text of own.py with a class Own."""

from __future__ import annotations

HEAD = "import numpy as np\nfrom caldrive import *\nfrom caldrive.datatypes import *\n"
SEEN = "Observation(self.time, np.zeros((4, 4, 3), np.uint8), 0.0, Command.STRAIGHT)"
CAR, ROUTE = "VehicleState(Pose(0, 0, 0))", "route_length=9.0, goal_distance=9.0"
WORLD = {
    "reset": ("self, scenario", f"self.time = 0.0; return {SEEN}"),
    "step": ("self, control", f"self.time += 0.1; return {SEEN}"),
    "truth": ("self", f"return Truth(time=self.time, ego={CAR}, affordances=Affordances(), {ROUTE})"),
    "close": ("self", "pass"),
}


def _agent(act: str, more: str = "") -> str:
    return f"{HEAD}class Own:\n{more} def reset(self): pass\n def act(self, observation):\n  {act}\n"


def _controller(step: str, more: str = "") -> str:
    return f"{HEAD}class Own:\n{more} def reset(self): pass\n def step(self, affordances, speed, command):\n  {step}\n"


def _world(dt: str = "0.1", **changes: str) -> str:
    """A world where nothing moves, with some methods replaced."""
    methods = (f" def {name}({given}):\n  {changes.get(name, body)}\n" for name, (given, body) in WORLD.items())
    return f"{HEAD}class Own:\n dt = {dt}\n{''.join(methods)}"


NO_CLASS = (
    "", "x =", "Own = 3", "\0", "import nothing_of_this_name", "raise SystemExit(3)", "import sys\nsys.exit()", "1 / 0",
    "def Own(): return None", "def Own(): raise KeyError(3)", "Own = None", "class Own: pass",
    "import own\nOwn = own.Own", "class Own:\n def __init__(self, a): pass", "Own = print",
    "class Own:\n def __init__(self): raise OSError", "class Own:\n def __init__(self): import sys; sys.exit(0)",
    "class Own:\n act = 5\n step = 6\n reset = 7", "class Own:\n def __getattr__(self, name): raise RuntimeError(name)",
    "raise MemoryError", "raise RecursionError",
    "class Odd(BaseException): pass\nraise Odd", "def f(): f()\nf()",
)  # fmt: skip
AGENTS = (
    *NO_CLASS,
    *(_agent(act) for act in (
        "return None", "return 1 / 0", "return 3", "return Control(9, 0, 0)", "return Control(float('nan'))",
        "return Control", "raise SystemExit", "raise StopIteration", "raise GeneratorExit", "yield Control()",
        "import sys; sys.exit()", "raise BrokenPipeError", "raise MemoryError", "return self.act(observation)",
        "observation.speed = 3", "object.__setattr__(c := Control(), 'steer', 9.0); return c",
        "object.__setattr__(c := Control(), 'steer', float('nan')); return c",
        "object.__setattr__(c := Control(), 'steer', 'left'); return c", "return Control(np.array([0.1, 0.2]))",
        "self.decision = 5; return Control()", "self.decision = Decision(None); return Control()",
        "self.decision = Decision(Control(), state=3); return Control()",
        "self.decision = Decision(Control(), Affordances(None)); return Control()",
        "self.decision = Decision(Control(), Affordances(speed_sign='30')); return Control()",
    )),
    *(_agent("return Control()", f" camera = {camera}\n") for camera in (
        "7", "CameraConfig(0, 0)", "CameraConfig(-5, 10)", "CameraConfig(10**6, 10**6)", "CameraConfig(fov=400)",
        "CameraConfig(fov=float('nan'))", "CameraConfig(fov=0)", "CameraConfig('200', 88)", "CameraConfig(2.5, 3.5)",
    )),
)  # fmt: skip
CONTROLLERS = (
    *NO_CLASS,
    *(_controller(step) for step in (
        "return None", "return 1 / 0", "return Control()", "return Decision(None)", "return Decision(3)",
        "return Decision(Control(9, 0, 0))", "return Decision(Control(), target_speed='fast')", "raise SystemExit",
    )),
    _controller("return Decision(Control())", " def __init__(self, cap, dt): raise ValueError\n"),
)  # fmt: skip
WORLDS = (
    *NO_CLASS,
    *(_world(reset=body) for body in ("return None", "return 1 / 0", "raise ValueError", "raise SystemExit")),
    *(_world(step=body) for body in ("return None", "return 1 / 0", "raise SystemExit", f"return {SEEN}")),
    *(_world(truth=body) for body in (
        "return None", "return 1 / 0", f"return Truth(time=self.time, ego=None, affordances=Affordances(), {ROUTE})",
        f"return Truth(time=float('nan'), ego={CAR}, affordances=Affordances(), {ROUTE})",
        f"return Truth(time=self.time, ego=VehicleState(Pose(float('nan'), 0, 0)), affordances=Affordances(), {ROUTE})",
    )),
    *(_world(dt) for dt in ("0", "-1", "None", "'x'", "float('nan')", "1e308")),
)  # fmt: skip
SEES = "Affordances(?, ?, ?, ?, ?, ?)"
MAYBE = (  # where a number takes the place of each question mark
    ("--agent", _agent("return Control(?, ?, ?)")),
    ("--agent", _agent(f"self.decision = Decision(Control(), {SEES}, None, ?, ?, 'x'); return Control()")),
    ("--agent", _agent("self.decision = Decision(Control(?), Affordances(), ?, ?, ?, ?); return Control(0.5)")),
    ("--controller", _controller("return Decision(Control(?, ?, ?))")),
    ("--controller", _controller("return Decision(Control(), affordances, 'x', ?, ?)")),
    ("--controller", _controller(f"return Decision(Control(), {SEES})")),
)
