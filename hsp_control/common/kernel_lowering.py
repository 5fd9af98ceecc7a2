"""Kernels' code for LLVM: less of it than Numba writes, since kernels own nothing.

Numba keeps each variable that several blocks use in memory, clears it when it is no
longer needed, and copies an array's seven or more words there to look at one. LLVM
finds out that nothing of this is needed, which takes a third of a cold start. Here a
variable that is assigned once is a value, an element of an array is read and written
where it is, and what an operation means for its types is looked up once.
"""

import operator
from typing import Any, cast

from llvmlite import ir as llvm
from numba.core import cgutils, compiler_machinery, ir, lowering, types
from numba.core import typed_passes as typed

_code, _types = cast("Any", cgutils), cast("Any", types)
_DATA, _SHAPE, _STRIDES = 4, 5, 6
"""Where these are among an array's words."""
_implementations: dict[tuple[Any, ...], Any] = {}
"""What operations mean, by operator and the types' identities; and the types, which
are to live as long."""


class _InstructionBuilder(cast("Any", llvm).IRBuilder):  # type: ignore[misc]
    """Writes instructions, but none to read what is known.

    A record's fields are arguments of a function, put together where it begins and
    taken apart where they are used.
    """

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        """Return an element of a value."""
        path = [*idx] if isinstance(idx, list | tuple) else [idx]
        while True:
            if type(agg) is llvm.instructions.InsertValue:
                put = agg.indices
                if path[: len(put)] == put:
                    path = path[len(put) :]
                    agg = agg.value
                    if not path:
                        return agg
                elif put[: len(path)] == path:
                    break  # a part of the element was put in
                else:
                    agg = agg.aggregate
            elif type(agg) is llvm.instructions.ExtractValue:
                path = [*agg.indices, *path]
                agg = agg.aggregate
                if type(agg) is not llvm.instructions.InsertValue:
                    break
            else:
                break
        return super().extract_value(agg, path, name)


_UNUSED = (
    llvm.instructions.InsertValue, llvm.instructions.ExtractValue,
    llvm.instructions.GEPInstr, llvm.instructions.LoadInstr,
)  # fmt: skip
"""Instructions that do nothing but give a value."""


def _remove_unused(function: Any) -> None:
    """Remove instructions whose value is not used."""
    uses: dict[int, int] = {}
    for block in function.blocks:
        for each in block.instructions:
            for operand in each.operands:
                uses[id(operand)] = uses.get(id(operand), 0) + 1
            for operand, _ in getattr(each, "incomings", ()):
                uses[id(operand)] = uses.get(id(operand), 0) + 1
    for block in reversed(function.blocks):
        kept = []
        for each in reversed(block.instructions):
            if isinstance(each, _UNUSED) and not uses.get(id(each)):
                for operand in each.operands:
                    uses[id(operand)] -= 1
            else:
                kept.append(each)
        block.instructions = kept[::-1]


class _KernelLower(cast("Any", lowering).Lower):  # type: ignore[misc]
    """Writes a kernel's code."""

    def setup_function(self, fndesc: Any) -> None:
        """Begin the function."""
        super().setup_function(fndesc)
        self.builder = _InstructionBuilder(self.entry_block)
        self.call_helper = self.call_conv.init_call_helper(self.builder)

    def lower_normal_function(self, fndesc: Any) -> None:
        """Write the function."""
        super().lower_normal_function(fndesc)
        _remove_unused(self.function)

    def _find_singly_assigned_variable(self) -> None:
        """Find what is a value: assigned once, and always before it is used."""
        lifetime = self.func_ir.variable_lifetime
        dominators = lifetime.cfg.dominators()
        where: dict[str, int] = {}
        again = set()
        for label, block in self.func_ir.blocks.items():
            for each in block.body:
                if isinstance(each, ir.Assign):
                    name = each.target.name
                    if name in where:
                        again.add(name)
                    where[name] = label
        for label, names in lifetime.usedefs.usemap.items():
            for name in names:
                first = where.get(name, label)
                # Blocks are written in the order of their labels.
                if first >= label or first not in dominators[label]:
                    again.add(name)
        self._singly_assigned_vars = where.keys() - again
        self._blk_local_varmap: dict[str, Any] = {}

    def _alloca_var(self, name: str, fetype: Any) -> None:
        """Make a place for a variable that is not a value."""
        if name not in self.varmap and name not in self._singly_assigned_vars:
            kind = self.context.get_value_type(fetype)
            self.varmap[name] = _code.alloca_once(self.builder, kind, name=name)

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Assign."""
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self._alloca_var(name, self.typeof(name))
            self.builder.store(value, self.varmap[name])

    def delvar(self, name: str) -> None:
        """Leave a variable that is no longer needed as it is."""

    def lower_getitem(
        self, resty: Any, expr: Any, value: Any, index: Any, signature: Any
    ) -> Any:
        """Read an element, or what lies at an index of the first axis."""
        array, place = (self.loadvar(each.name) for each in (value, index))
        kinds = self.typeof(value.name), self.typeof(index.name)
        array, place = (
            self.context.cast(self.builder, each, kind, to)
            for each, kind, to in zip(
                (array, place), kinds, signature.args, strict=True
            )
        )
        kind, of_index = signature.args
        if _is_element(kind, of_index, signature.return_type):
            pointer = self._pointer(kind, array, of_index, place)
            found = self.context.unpack_value(
                self.builder, kind.dtype, pointer, None if kind.aligned else 1
            )
        else:
            read = self._implementation(operator.getitem, signature.args)
            found = read(self.builder, (array, place))
        return self.context.cast(self.builder, found, signature.return_type, resty)

    def lower_setitem(
        self, target_var: Any, index_var: Any, value_var: Any, signature: Any
    ) -> Any:
        """Write an element, or a part of an array."""
        given = target_var, index_var, value_var
        values = [self.loadvar(each.name) for each in given]
        array, place, value = (
            self.context.cast(self.builder, each, self.typeof(name.name), to)
            for each, name, to in zip(values, given, signature.args, strict=True)
        )
        kind, of_index, of_value = signature.args
        if _is_element(kind, of_index, None):
            value = self.context.cast(self.builder, value, of_value, kind.dtype)
            pointer = self._pointer(kind, array, of_index, place)
            aligned = None if kind.aligned else 1
            self.context.pack_value(self.builder, kind.dtype, value, pointer, aligned)
            return None
        write = self._implementation(operator.setitem, signature.args)
        return write(self.builder, (array, place, value))

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        """Read an array's shape where it is; all else is as in Numba."""
        if expr.op == "getattr" and expr.attr == "shape":
            kind = self.typeof(expr.value.name)
            if type(kind) is types.Array:
                return self.builder.extract_value(self.loadvar(expr.value.name), _SHAPE)
        return super().lower_expr(resty, expr)

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        """Compute; powers with a written exponent are as in Numba."""
        if not expr.static_lhs is expr.static_rhs is ir.UNDEFINED:
            return super().lower_binop(resty, expr, op)
        signature = self.fndesc.calltypes[expr]
        operands = [
            self.context.cast(
                self.builder, self.loadvar(each.name), self.typeof(each.name), to
            )
            for each, to in zip((expr.lhs, expr.rhs), signature.args, strict=True)
        ]
        compute = self._implementation(op, signature.args)
        result = compute(self.builder, operands)
        return self.context.cast(self.builder, result, signature.return_type, resty)

    def _implementation(self, op: Any, kinds: tuple[Any, ...]) -> Any:
        """Return what writes the code of an operator on these types."""
        key = op, *map(id, kinds)
        found = _implementations.get(key)
        if found is None:
            typing = self.context.typing_context
            function = typing.resolve_value_type(op)
            signature = function.get_call_type(typing, kinds, {})
            found = self.context.get_function(function, signature), kinds
            _implementations[key] = found
        return found[0]

    def _pointer(self, kind: Any, array: Any, of_index: Any, place: Any) -> Any:
        """Return where an element of an array is; negative indices count back."""
        builder = self.builder
        if isinstance(of_index, _types.BaseTuple):
            given = _code.unpack_tuple(builder, place, count=len(of_index))
            of_indices = tuple(of_index)
        else:
            given, of_indices = [place], (of_index,)
        shape = [
            builder.extract_value(array, (_SHAPE, axis)) for axis in range(kind.ndim)
        ]
        indices = []
        for index, of_one, size in zip(given, of_indices, shape, strict=True):
            signed = of_one.signed
            index = self.context.cast(
                builder, index, of_one, types.intp if signed else types.uintp
            )
            if isinstance(index, llvm.Constant) and index.constant >= 0:
                indices.append(index)
            elif isinstance(index, llvm.Constant):
                indices.append(builder.add(size, index))
            elif signed:
                negative = builder.icmp_signed("<", index, index.type(0))
                back = builder.add(size, index)
                indices.append(builder.select(negative, back, index))
            else:
                indices.append(index)
        data = builder.extract_value(array, _DATA)
        if kind.layout == "A":
            offset = None
            for axis, index in enumerate(indices):
                stride = builder.extract_value(array, (_STRIDES, axis))
                part = builder.mul(stride, index)
                offset = part if offset is None else builder.add(offset, part)
            return _code.pointer_add(builder, data, offset)
        axes = list(zip(indices, shape, strict=True))
        (offset, _), *others = axes if kind.layout == "C" else axes[::-1]
        for index, size in others:
            offset = builder.add(builder.mul(offset, size), index)
        return builder.gep(data, [offset])


def _is_element(kind: Any, of_index: Any, found: Any) -> bool:
    """Say whether integers name one element of an array of numbers."""
    if type(kind) is not types.Array or (found is not None and found is not kind.dtype):
        return False
    if kind.ndim == 0 or not isinstance(kind.dtype, types.Number | types.Boolean):
        return False
    if isinstance(of_index, _types.BaseTuple):
        integers = all(isinstance(each, types.Integer) for each in of_index)
        return integers and len(of_index) == kind.ndim
    return kind.ndim == 1 and isinstance(of_index, types.Integer)


@cast("Any", compiler_machinery).register_pass(mutates_CFG=False, analysis_only=False)
class KernelLowering(cast("Any", typed).BaseNativeLowering):  # type: ignore[misc]
    """Numba's pass that writes the code for LLVM."""

    _name = "kernel_lowering"
    lowering_class = _KernelLower
