"""Rooms: folders in the order of the production pipeline, whose imports never run back, and what belongs to one alone."""

import ast
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1] / "src" / "lightdepth"
STARTS_AND_FEEDS = {"load_dict", "load_file", "load_string", "set_variant", "Bitmap", "Mesh", "register_bsdf"}
"""What of Mitsuba only ``kernel`` may call: it starts it, and makes its objects out of ours."""


@cache
def modules():
    return [(file.relative_to(ROOT), ast.parse(file.read_text())) for file in sorted(ROOT.rglob("*.py"))]


def imported(tree):
    """Names of modules, also of those that are imported where they are needed only."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports name the whole module"
            yield from ([f"{node.module}.{name.name}" for name in node.names] + [str(node.module)])


def room(module):
    """The folder, or the file beside the folders, of a module of lightdepth; none for the package itself."""
    parts = module.split(".")
    return parts[1] if parts[0] == "lightdepth" and len(parts) > 1 else None


def is_module(name):
    path = ROOT.joinpath(*name.split(".")[1:])
    return path.is_dir() or path.with_suffix(".py").is_file()


def graph():
    arrows = {}
    for path, tree in modules():
        here = path.parts[0].removesuffix(".py")
        used = {room(name) for name in imported(tree) if room(name) and is_module(f"lightdepth.{room(name)}")}
        arrows.setdefault(here, set()).update(used - {here})
    return arrows


def test_no_arrow_between_rooms_runs_back():
    order = list(TopologicalSorter(graph()).static_order())  # Fails, and names the rooms, where arrows form a circle.
    for one, later in [("scene", "place"), ("place", "recovery"), ("recovery", "preparation"), ("preparation", "film")]:
        assert order.index(one) < order.index(later)
    for path, tree in modules():
        plain = [name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names]
        assert "lightdepth" not in plain, f"{path} imports the package's front, which imports all"
        if path != Path("__init__.py"):
            front = [name for name in imported(tree) if room(name) and not is_module(f"lightdepth.{room(name)}")]
            assert not front, f"{path} imports {', '.join(front)} from the package's front, which imports all"


def test_the_cache_of_places_knows_all_code_that_recovers_them():
    """A module that recovery comes to use later must not leave what the old one recovered valid."""
    trees = {".".join(["lightdepth", *path.with_suffix("").parts]): tree for path, tree in modules()}
    decide_nothing = {"cancellation", "errors", "files", "store", "work"}
    seen, left = set(), {"lightdepth.preparation.place"}
    while left:
        module = left.pop()
        seen.add(module)
        for name in imported(trees[module]):
            left |= {name, f"{name}.__init__", name.rpartition(".")[0]} & trees.keys() - seen
    used = {room(module) for module in seen} - decide_nothing
    assert "recovery" in used
    body = trees["lightdepth.preparation.place"].body
    code = next(n.value for n in body if isinstance(n, ast.Assign) and ast.unparse(n.targets[0]) == "CODE")
    assert used <= {name.removesuffix(".py") for name in ast.literal_eval(code)}


def test_only_the_kernel_starts_mitsuba_and_makes_its_objects():
    callers = {}
    for path, tree in modules():
        for node in ast.walk(tree):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and isinstance(node.func.value, ast.Name)
                and node.func.value.id == "mi"
                and node.func.attr in STARTS_AND_FEEDS
            ):
                callers.setdefault(path.parts[0], set()).add(node.func.attr)
    assert set(callers) == {"kernel"}
    assert callers["kernel"] >= {"load_dict", "set_variant", "Bitmap", "Mesh", "register_bsdf"}


def test_what_comes_before_the_device_does_not_need_it():
    """Scenes are read, images written and panoramas captured without starting a device."""
    for path, tree in modules():
        needs = {name.split(".")[0] for name in imported(tree)} & {"mitsuba", "drjit"}
        if needs:
            assert path.parts[0] in {
                "api.py",
                "cameras",
                "film",
                "kernel",
                "place",
                "preparation",
                "recovery",
                "sequence",
                "transport",
            }
