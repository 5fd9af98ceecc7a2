"""Pinocchio's functions as native calls, without its Python bindings in between.

The bindings convert arguments and results at each call: for an arm with seven joints
that costs as much as the dynamics themselves. Here the very functions that the bindings
call are found in Pinocchio's library by their C++ names, and the model and the data in
its Python objects by Boost.Python's own registry. So there is one dynamics, and its
results are the same to the last bit.

What this relies on is looked at before the first call (`unknown`). Where it is not as
known, the bindings are called.
"""

import ctypes
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
import pinocchio as pin
from pinocchio import pinocchio_pywrap_default

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices, matrix_view
from hsp_control.engine import ForeignCall, Plan, PythonCall, Runnable

_MODEL = b"N9pinocchio8ModelTplIdLi0ENS_25JointCollectionDefaultTplEEE"
_DATA = b"N9pinocchio7DataTplIdLi0ENS_25JointCollectionDefaultTplEEE"
"""The C++ names of the types `pin.Model` and `pin.Data`."""

# Of the templates, Pinocchio's library has those for Eigen::Ref<const VectorXd>.
_TEMPLATE = "IdLi0ENS_25JointCollectionDefaultTplEN5Eigen3RefI"
_IN_IMPL = "KNS3_6MatrixIdLin1ELi1ELi0ELin1ELi1EEELi0ENS3_11InnerStrideILi1EEEEE"
_OUTSIDE = "KNS2_6MatrixIdLin1ELi1ELi0ELin1ELi1EEELi0ENS2_11InnerStrideILi1EEEEE"
_NAMES = {
    "computeJointJacobiansTimeVariation": (
        f"_ZN9pinocchio4impl34computeJointJacobiansTimeVariation{_TEMPLATE}{_IN_IMPL}"
        "SA_EERKNS_7DataTplIT_XT0_ET1_E8Matrix6xERKNS_8ModelTplISC_XT0_ESD_EERSE_"
        "RKNS3_10MatrixBaseIT2_EERKNSN_IT3_EE"
    ),
    "computeCentroidalMapTimeVariation": (
        f"_ZN9pinocchio4impl33computeCentroidalMapTimeVariation{_TEMPLATE}{_IN_IMPL}"
        "SA_EERKNS_7DataTplIT_XT0_ET1_E8Matrix6xERKNS_8ModelTplISC_XT0_ESD_EERSE_"
        "RKNS3_10MatrixBaseIT2_EERKNSN_IT3_EE"
    ),
    "computeCoriolisMatrix": (
        f"_ZN9pinocchio4impl21computeCoriolisMatrix{_TEMPLATE}{_IN_IMPL}"
        "SA_EERKNS_7DataTplIT_XT0_ET1_E8MatrixXsERKNS_8ModelTplISC_XT0_ESD_EERSE_"
        "RKNS3_10MatrixBaseIT2_EERKNSN_IT3_EE"
    ),
    "rnea": (
        f"_ZN9pinocchio4impl4rnea{_TEMPLATE}{_IN_IMPL}"
        "SA_SA_EERKNS_7DataTplIT_XT0_ET1_E17TangentVectorTypeERKNS_8ModelTplISC_XT0_"
        "ESD_EERSE_RKNS3_10MatrixBaseIT2_EERKNSN_IT3_EERKNSN_IT4_EE"
    ),
    "crba": (
        f"_ZN9pinocchio4crba{_TEMPLATE}{_OUTSIDE}"
        "EERKNS_7DataTplIT_XT0_ET1_E8MatrixXsERKNS_8ModelTplISB_XT0_ESC_EERSD_"
        "RKNS2_10MatrixBaseIT2_EENS_10ConventionE"
    ),
    "aba": (
        f"_ZN9pinocchio3aba{_TEMPLATE}{_OUTSIDE}"
        "S9_S9_EERKNS_7DataTplIT_XT0_ET1_E17TangentVectorTypeERKNS_8ModelTplISB_XT0_"
        "ESC_EERSD_RKNS2_10MatrixBaseIT2_EERKNSM_IT3_EERKNSM_IT4_EENS_10ConventionE"
    ),
}
"""The C++ names of the functions, by Pinocchio's own; ``c++filt`` reads them."""

_WITHOUT_MIMICS = "computeCentroidalMapTimeVariation", "computeCoriolisMatrix", "aba"
"""What Pinocchio does not support for models with mimic joints: the bindings know."""

_QUERY = "_ZN5boost6python9converter8registry5queryENS0_9type_infoE"
_EXTRACT = (
    "_ZN5boost6python9converter22get_lvalue_from_pythonEP7_objectRKNS1_12registrationE"
)

_LOCAL = int(pin.Convention.LOCAL)
"""The bindings' default."""


class _TypeName(ctypes.Structure):
    """`boost::python::type_info`."""

    _fields_ = (("name", ctypes.c_char_p),)


@cache
def _library() -> ctypes.CDLL:
    """Return the module of the bindings: a look-up finds what it is linked to, too."""
    return ctypes.CDLL(pinocchio_pywrap_default.__file__)


def _address(name: str) -> int:
    """Return the address of a function, 0 if there is none of this C++ name."""
    try:
        function = _library()[name]
    except AttributeError:
        return 0
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def _object_address(owner: object, kind: bytes) -> int:
    """Return where the C++ object of a Python object of Pinocchio is."""
    query, extract = _library()[_QUERY], _library()[_EXTRACT]
    query.argtypes, query.restype = [_TypeName], ctypes.c_void_p
    extract.argtypes = [ctypes.py_object, ctypes.c_void_p]
    extract.restype = ctypes.c_void_p
    registration = query(_TypeName(kind))
    return (registration and extract(owner, registration)) or 0


def _reference(vector: Array) -> Indices:
    """Return an ``Eigen::Ref<const VectorXd>`` of a vector: its data and its size."""
    words = np.zeros(8, dtype=np.int64)  # the rest is room for a copy, not made here
    words[:2] = vector.ctypes.data, vector.size
    return words


@cache
def unknown() -> str:
    """Return what keeps Pinocchio from being called natively, or nothing."""
    for name in (*_NAMES.values(), _QUERY, _EXTRACT):
        if not _address(name):
            return f"Pinocchio {pin.__version__} has no function {name}"
    return ""


def is_pinocchio(function: Callable[..., object]) -> bool:
    """Return whether `bind_pinocchio` knows a function."""
    return type(function) is type(pin.crba) and function.__name__ in _NAMES


def bind_pinocchio(
    what: str, model: pin.Model, data: pin.Data, *vectors: Array
) -> "PinocchioCall | PythonCall":
    """Return a call that computes from what these arrays then hold, into the data.

    Args:
        what: The function: ``computeJointJacobiansTimeVariation`` (q, v), into J and
            dJ; ``computeCentroidalMapTimeVariation`` (q, v), into Ag and dAg;
            ``computeCoriolisMatrix`` (q, v), into C; ``rnea`` (q, v, a), into tau;
            ``crba`` (q), into M, both triangles; ``aba`` (q, v, tau), into ddq.
        model: The model.
        data: Its data.
        vectors: The arrays; they are kept. What is no packed vector of doubles of the
            model's size is left to the bindings.
    """
    sizes = model.nq, model.nv, model.nv
    refused = what in _WITHOUT_MIMICS and len(model.mimicking_joints) > 0
    if not refused and not unknown() and all(map(_fits, vectors, sizes)):
        addresses = _object_address(model, _MODEL), _object_address(data, _DATA)
        if all(addresses):
            return _native(what, addresses, (model, data, *vectors))
    return PythonCall(partial(getattr(pin, what), model, data, *vectors))


def _fits(vector: Array, size: int) -> bool:
    """Return whether native code may read a vector: C++ would not ask again."""
    packed = vector.shape == (size,) and vector.flags.c_contiguous
    return packed and vector.dtype == np.float64 and vector.flags.aligned


class PinocchioCall:
    """A function of Pinocchio with its arguments; copies compute with their own."""

    __slots__ = ("_arguments", "_call")
    python = False

    def __init__(self, call: Runnable, *arguments: Any) -> None:
        self._call, self._arguments = call, arguments

    @property
    def row(self) -> tuple[int, int]:
        """The addresses of the function and of its arguments; see `engine.Plan`."""
        return self._call.row

    def __call__(self, t: float = 0.0) -> float:
        """Make the call."""
        return self._call(t)

    def __repr__(self) -> str:
        return f"PinocchioCall({self._arguments[0]})"

    def __reduce__(self) -> tuple[Any, ...]:
        return bind_pinocchio, self._arguments


def _native(
    what: str, addresses: tuple[int, int], arguments: tuple[Any, ...]
) -> PinocchioCall:
    _, data, *vectors = arguments
    references = [_reference(vector) for vector in vectors]
    words = [*addresses, *(words.ctypes.data for words in references)]
    if what in ("crba", "aba"):
        words.append(_LOCAL)
    kept = arguments, references
    call: Runnable = ForeignCall(_address(_NAMES[what]), words, kept)
    if what == "crba":  # writes one triangle
        call = Plan([call, engine.Mirror(M=matrix_view(data.M))])
    return PinocchioCall(call, what, *arguments)
