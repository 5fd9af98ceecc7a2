"""Kernels' code for LLVM: less of it than Numba writes, since kernels own nothing.

Numba keeps each variable that several blocks use in memory, clears it when it is no
longer needed, copies an array's seven or more words there to look at one, and counts
how often a loop will run before it begins. LLVM finds out that nothing of this is
needed, which takes long. Here a variable that is assigned once is a
value, an element of an array is read and written where it is, a part of an array is
seven words, a loop counts, and what an operation means for its types is looked up once.
"""

import operator
from collections.abc import Iterable
from typing import Any, cast

from llvmlite import ir as llvm
from numba.core import cgutils, compiler_machinery, ir, lowering, types
from numba.core import typed_passes as typed

_code, _types = cast("Any", cgutils), cast("Any", types)
_COUNT, _ITEM, _DATA, _SHAPE, _STRIDES = range(2, 7)
"""Where these are among an array's words."""
_WORD, _END = llvm.IntType(64), 2**63 - 1
"""An integer, and the one that stands for no end of a slice."""
_LESS = (
    "pair_first", "pair_second", "iternext", "getiter", "getattr", "static_getitem",
)  # fmt: skip
"""What is written with fewer instructions than Numba does."""
_COUNTING = types.range_iter32_type, types.range_iter64_type
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
                put = [*agg.indices]
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
        elif parts := self._parts(kind, of_index, place, signature.return_type):
            found = self._view(kind, array, parts, signature.return_type)
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
        """Write shapes, parts of arrays and loops; all else is as in Numba."""
        op, builder = expr.op, self.builder
        if op == "call":
            if type(resty) is types.RangeType and resty.dtype.signed:
                return self._range(resty, self._integers(expr, resty.dtype))
            if type(resty) is _types.SliceType and not resty.has_step:
                *first, end = self._integers(expr, types.intp)
                start = first[0] if first and first[0] else _WORD(0)
                return self._record(resty, (start, end or _WORD(_END), _WORD(1)))
            return super().lower_expr(resty, expr)
        if op not in _LESS:
            return super().lower_expr(resty, expr)
        kind, value = self.typeof(expr.value.name), self.loadvar(expr.value.name)
        if op == "pair_first" or op == "pair_second":
            return builder.extract_value(value, int(op == "pair_second"))
        if op == "iternext" and kind in _COUNTING:
            return self._next(resty, value)
        if op == "getiter" and resty in _COUNTING:
            start, stop, step = (builder.extract_value(value, k) for k in range(3))
            place = _code.alloca_once(builder, start.type)
            builder.store(start, place)
            return self._record(resty, (place, stop, step, place))
        if type(kind) is types.Array:
            if op == "getattr" and expr.attr == "shape":
                return builder.extract_value(value, _SHAPE)
            if op == "static_getitem" and type(resty) is types.Array:
                parts = _written(expr.index)
                if parts is not None:
                    return self._view(kind, value, parts, resty)
        return super().lower_expr(resty, expr)

    def _record(self, kind: Any, values: Iterable[Any]) -> Any:
        """Return values as one."""
        record = llvm.Constant(self.context.get_value_type(kind), llvm.Undefined)
        for k, value in enumerate(values):
            record = self.builder.insert_value(record, value, k)
        return record

    def _integers(self, call: Any, kind: Any) -> list[Any]:
        """Return the arguments of a call, None where one is None."""
        given = [(self.typeof(each.name), each.name) for each in call.args]
        return [
            None if of is types.none
            else self.context.cast(self.builder, self.loadvar(name), of, kind)
            for of, name in given
        ]  # fmt: skip

    def _range(self, kind: Any, given: list[Any]) -> Any:
        """Return a range: start, stop, step."""
        zero, one = (self.context.get_constant(kind.dtype, k) for k in range(2))
        start, stop, *step = given if given[1:] else (zero, *given)
        return self._record(kind, (start, stop, *(step or [one])))

    def _next(self, kind: Any, iterator: Any) -> Any:
        """Return the next number of a range, and whether there is one."""
        builder = self.builder
        place, stop, step = (builder.extract_value(iterator, k) for k in range(3))
        value = builder.load(place)
        before, after = (builder.icmp_signed(s, value, stop) for s in "<>")
        upwards = builder.icmp_signed(">", step, step.type(0))
        builder.store(builder.add(value, step, flags=["nsw"]), place)
        return self._record(kind, (value, builder.select(upwards, before, after)))

    def _parts(self, kind: Any, of_index: Any, place: Any, found: Any) -> Any:
        """Return an index as integers and pairs of bounds, None if it is another."""
        if type(kind) is not types.Array or type(found) is not types.Array:
            return None
        parts: list[Any] = []
        for part, of_one in self._each(of_index, place):
            if isinstance(of_one, _types.Integer) and of_one.signed:
                parts.append(self.context.cast(self.builder, part, of_one, types.intp))
            elif type(of_one) is _types.SliceType and not of_one.has_step:
                parts.append([self.builder.extract_value(part, k) for k in range(2)])
            else:
                return None
        return parts

    def _each(self, of_index: Any, place: Any) -> list[tuple[Any, Any]]:
        """Return the parts of an index and their types."""
        if not isinstance(of_index, _types.BaseTuple):
            return [(place, of_index)]
        given = _code.unpack_tuple(self.builder, place, count=len(of_index))
        return [*zip(given, of_index, strict=True)]

    def _view(self, kind: Any, array: Any, parts: list[Any], found: Any) -> Any:
        """Return a part of an array, which is an array."""
        builder, context = self.builder, self.context
        item = _WORD(context.get_abi_sizeof(context.get_data_type(kind.dtype)))
        sizes = [builder.extract_value(array, (_SHAPE, k)) for k in range(kind.ndim)]
        steps = [builder.extract_value(array, (_STRIDES, k)) for k in range(kind.ndim)]
        if kind.layout == "C":  # whose strides are known
            steps = [item]
            for size in sizes[:0:-1]:
                steps.insert(0, builder.mul(size, steps[0]))
        data, shape, strides = builder.extract_value(array, _DATA), [], []
        for axis, (size, step) in enumerate(zip(sizes, steps, strict=True)):
            part = parts[axis] if axis < len(parts) else (_WORD(0), _WORD(_END))
            if isinstance(part, llvm.Value):
                first = self._counted_back(part, size)
            else:
                first, end = (self._bound(each, size) for each in part)
                whole = first == _WORD(0)
                shape.append(
                    end if whole else self._larger(builder.sub(end, first), _WORD(0))
                )
                strides.append(step)
            if first != _WORD(0):
                data = _code.pointer_add(builder, data, builder.mul(first, step))
        count = shape[0]
        for size in shape[1:]:
            count = builder.mul(count, size)
        view = llvm.Constant(context.get_value_type(found), None)  # it owns nothing
        for k, value in ((_COUNT, count), (_ITEM, item), (_DATA, data)):
            view = builder.insert_value(view, value, k)
        for k, values in ((_SHAPE, shape), (_STRIDES, strides)):
            for axis, value in enumerate(values):
                view = builder.insert_value(view, value, (k, axis))
        return view

    def _bound(self, bound: Any, size: Any) -> Any:
        """Return a bound of a slice, between 0 and the axis' size."""
        if isinstance(bound, llvm.Constant) and bound.constant in (0, _END):
            return size if bound.constant else bound
        bound = self._larger(self._counted_back(bound, size), _WORD(0))
        beyond = self.builder.icmp_signed(">", bound, size)
        return self.builder.select(beyond, size, bound)

    def _larger(self, a: Any, b: Any) -> Any:
        """Return the larger of two integers."""
        return self.builder.select(self.builder.icmp_signed(">", a, b), a, b)

    def _counted_back(self, index: Any, size: Any) -> Any:
        """Return an index from the beginning: negative ones count back."""
        builder = self.builder
        if isinstance(index, llvm.Constant):
            return index if index.constant >= 0 else builder.add(size, index)
        negative = builder.icmp_signed("<", index, index.type(0))
        return builder.select(negative, builder.add(size, index), index)

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
        shape = [
            builder.extract_value(array, (_SHAPE, axis)) for axis in range(kind.ndim)
        ]
        indices = []
        for (index, of_one), size in zip(
            self._each(of_index, place), shape, strict=True
        ):
            signed = of_one.signed
            to = types.intp if signed else types.uintp
            index = self.context.cast(builder, index, of_one, to)
            indices.append(self._counted_back(index, size) if signed else index)
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


def _written(index: Any) -> list[Any] | None:
    """Return an index that is written in the code as integers and pairs of bounds."""
    parts: list[Any] = []
    for part in index if isinstance(index, tuple) else (index,):
        if isinstance(part, int):
            parts.append(_WORD(part))
        elif isinstance(part, slice) and part.step is None:
            end = _END if part.stop is None else part.stop
            parts.append((_WORD(part.start or 0), _WORD(end)))
        else:
            return None
    return parts


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
