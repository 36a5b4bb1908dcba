"""The parameters of attacks and the words that they may be, for shells: read from the source of their
classes, as importing these takes seconds."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

FOLDER = Path(__file__).parent
PACKAGES = ("advpipe.stages.attack.", "advpipe.pipeline.adversary.")
"""Where what attacks are made of stands."""
CATALOGUES = ("veremi", "f2md", "nextgen")
"""The data sets whose attacks are presets of ours."""
SWITCH = ("true", "false")
"""The words that a parameter without numbers may be where it is a switch."""


def parameter_words(attack: str) -> dict[str, tuple[str, ...]]:
    """The parameters of a registered attack, with `recipe`; each with the words that it may be, () for
    numbers and free texts. Empty for an unknown attack."""
    for path in FOLDER.glob("*/registry.py"):
        registry = _Source(path)
        for call in _calls(registry.tree, "add"):
            match call.args:
                case [ast.Constant(value=name), ast.Name(id=class_name)] if name == attack:
                    presets = tuple(_presets(attack))
                    return registry.parameters(class_name) | ({"preset": presets} if presets else {})
    return {}


def _presets(attack: str) -> Iterator[str]:
    """The data sets whose code has an attack of this name."""
    for name in CATALOGUES:
        for node in _Source(FOLDER / "v2x" / "published" / f"{name}.py").tree.body:
            match node:
                case ast.AnnAssign(target=ast.Name(id="PRESETS"), value=ast.Dict(keys=keys)):
                    if attack in (key.value for key in keys if isinstance(key, ast.Constant)):
                        yield name


@dataclass(frozen=True)
class _Source:
    """A module of ours, read and not run."""

    path: Path

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.path.read_text(encoding="utf-8"))

    @cached_property
    def imported(self) -> dict[str, _Source]:
        """The modules of the attacks that names come from."""
        return {
            name.asname or name.name: _Source(FOLDER.parents[1].joinpath(*folders, f"{module}.py"))
            for node in ast.walk(self.tree)
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(PACKAGES)
            for _, *folders, module in [(node.module or "").split(".")]
            for name in node.names
        }

    def parameters(self, class_name: str) -> dict[str, tuple[str, ...]]:
        """Those of a class: its fields, or what its `__init__` takes by name, and what its bases take."""
        if class_name in self.imported:
            return self.imported[class_name].parameters(class_name)
        found = [one for one in self.tree.body if isinstance(one, ast.ClassDef) and one.name == class_name]
        if not found:
            return {}
        (node,) = found
        made = [one for one in node.body if isinstance(one, ast.FunctionDef) and one.name == "__init__"]
        taken: dict[str, tuple[ast.expr | None, ast.expr | None]]  # annotation and default
        if made:
            arguments = made[0].args
            pairs = zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
            taken = {one.arg: (one.annotation, default) for one, default in pairs}
        else:
            fields = [one for one in node.body if isinstance(one, ast.AnnAssign) and _is_field(one)]
            taken = {ast.unparse(one.target): (one.annotation, one.value) for one in fields}
        bases = [base.id for base in node.bases if isinstance(base, ast.Name)]
        of_bases = {name: one for base in bases for name, one in self.parameters(base).items()}
        words = {
            name: self._words(name, *about, node) or of_bases.get(name, ()) for name, about in taken.items()
        }
        return words if made and made[0].args.kwarg is None else {**of_bases, **words}

    def _words(
        self, name: str, annotation: ast.expr | None, default: ast.expr | None, node: ast.ClassDef
    ) -> tuple[str, ...]:
        if isinstance(annotation, ast.Name) and annotation.id == "bool":
            return SWITCH
        if isinstance(default, ast.Subscript):  # the first of those that are known
            return tuple(self._texts(default.value))
        for call in _calls(node, "checked_choice"):
            match call.args:
                case [_, ast.Constant(value=parameter), _, known] if parameter == name:
                    return tuple(self._texts(known))
        return ()

    def _texts(self, node: ast.expr) -> Iterator[str]:
        """The texts of a literal, the keys of a dictionary, and what names of both stand for."""
        match node:
            case ast.Constant(value=str(text)):
                yield text
            case ast.Tuple(elts=items) | ast.Dict(keys=items):
                for item in items:
                    if item is not None:
                        yield from self._texts(item)
            case ast.Starred(value=value):
                yield from self._texts(value)
            case ast.Name(id=name) if name in self.imported:
                yield from self.imported[name]._texts(node)
            case ast.Name(id=name):
                for one in self.tree.body:
                    match one:
                        case ast.Assign(targets=[ast.Name(id=target)], value=value) if target == name:
                            yield from self._texts(value)
                        case ast.AnnAssign(target=ast.Name(id=target), value=ast.expr() as value) if (
                            target == name
                        ):
                            yield from self._texts(value)


def _is_field(node: ast.AnnAssign) -> bool:
    """Whether an annotation in a class's body is a field of a dataclass."""
    return "ClassVar" not in ast.unparse(node.annotation) and not ast.unparse(node.target).startswith("_")


def _calls(node: ast.AST, function: str) -> Iterator[ast.Call]:
    for one in ast.walk(node):
        if isinstance(one, ast.Call) and isinstance(one.func, ast.Name) and one.func.id == function:
            yield one
