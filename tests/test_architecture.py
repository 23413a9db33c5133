"""The layers of the house: imports point down only, ways never import ways, modules stay small."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent.parent / "src" / "subtense"
WAYS = {"camera_sources", "detectors", "methods", "reports"}
FACES = {"cli", "commands", "web", "batch"}
BASE = {"errors", "arrays", "distribution", "quantity", "noun", "space", "propagate", "geometry", "method"}
HEAVY = {
    "cv2",
    "scipy",
    "PIL",
    "pillow_heif",
    "rawpy",
    "reportlab",
    "tomllib",
    "defusedxml",
    "matplotlib",
    "lensfunpy",
    "pycolmap",
    "pyapriltags",
    "laspy",
    "rasterio",
    "ai_edge_litert",
    "onnxruntime",
}
ALLOWED = {"numpy", "click", *HEAVY}


def layer(module: str) -> int:
    """0 base, 1 nouns, 2 ways, 3 workflow, 4 faces."""
    top = module.split(".")[0]
    return 4 if top in FACES else 3 if top == "workflow" else 2 if top in WAYS else 0 if top in BASE else 1


def imports(text: str, module: str, *, package: bool = False):
    """(imported module, whether at the top of the file) of a module's source, relative to the package."""
    tree = ast.parse(text)
    top = set(tree.body) | {n for node in tree.body if isinstance(node, ast.If) for n in node.body}
    parts = module.split(".") if module else []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = parts[: len(parts) - node.level + (1 if package else 0)]
            names = [".".join([*base, node.module])] if node.module else [".".join([*base, a.name]) for a in node.names]
            yield from ((name, node in top) for name in names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module, node in top
        elif isinstance(node, ast.Import):
            yield from ((alias.name, node in top) for alias in node.names)


def modules():
    for path in sorted(SOURCE.rglob("*.py")):
        relative = path.relative_to(SOURCE).with_suffix("")
        package = relative.name == "__init__"
        parts = relative.parts[:-1] if package else relative.parts
        yield ".".join(parts), path, package


OURS = {name for name, _, _ in modules()}


def wrong(module: str, text: str, *, package: bool = False):
    """What this module imports against the rules."""
    found = []
    for name, at_top in imports(text, module, package=package):
        inner = name in OURS or name.split(".")[0] in {n.split(".")[0] for n in OURS if n}
        if inner and module:
            if layer(name) > layer(module) and not (module.split(".")[0] in BASE and layer(name) == 0):
                found.append(f"{module} imports {name}, which lies above it")
            mine, theirs = module.split(".")[0], name.split(".")[0]
            way = mine in WAYS and theirs in WAYS and name != module
            if way and not (
                mine == theirs == "reports" and name in ("reports.rounding", "reports.table", "reports.inputs")
            ):
                found.append(f"{module} is a way and imports the way {name}")
        top = name.split(".")[0]
        if not inner and at_top and top in HEAVY:
            found.append(f"{module} imports {top} at its top, which makes every start slow")
    return found


@pytest.mark.parametrize(("module", "path", "package"), list(modules()), ids=lambda x: x if isinstance(x, str) else "")
def test_imports_point_down(module, path, package):
    assert wrong(module, path.read_text(), package=package) == []


@pytest.mark.parametrize(
    ("module", "text"),
    [
        ("camera", "from .workflow import tables"),
        ("geometry", "from .camera import Camera"),
        ("methods.pose", "from ..detectors import markers"),
        ("methods.pose", "from .known_size import derivative"),
        ("methods.pose", "import cv2"),
        ("workflow.measure", "from ..cli import main"),
    ],
)
def test_a_planted_violation_is_seen(module, text):
    assert wrong(module, text)


@pytest.mark.parametrize(("module", "path", "package"), list(modules()), ids=lambda x: x if isinstance(x, str) else "")
def test_modules_and_functions_stay_small(module, path, package):
    text = path.read_text()
    assert len(text.splitlines()) <= 600
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            lines = body[-1].end_lineno - body[0].lineno + 1 if body else 0
            assert lines <= 45, f"{module}.{node.name} has {lines} lines"


def test_everything_public_has_a_docstring():
    for module, path, _ in modules():
        tree = ast.parse(path.read_text())
        assert ast.get_docstring(tree), module
        for node in tree.body:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
                assert ast.get_docstring(node), f"{module}.{node.name}"
