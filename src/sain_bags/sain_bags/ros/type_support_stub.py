"""Stands in for message types that are not installed, so that their bytes can be taken.

rclpy subscribes by a type's class, and that carries what rosidl generated for the type. Whoever
takes raw bytes needs none of it but the type's name and hash. So a copy is made of what stands for
``std_msgs/msg/String``, as long as any message may be, and only the name and the hash are replaced.
Fast DDS's own, as ``rmw_fastrtps_cpp`` uses it: structures of rosidl_runtime_c's
message_type_support_struct.h and rosidl_typesupport_fastrtps_cpp's message_type_support.h.
"""

import ctypes
from typing import Any, Final

from rclpy.utilities import get_rmw_implementation_identifier

from sain_core.errors import InvalidInputError

MIDDLEWARE: Final = "rmw_fastrtps_cpp"
FAST: Final = "rosidl_typesupport_fastrtps_c"
ANY: Final = "rosidl_typesupport_c"
MODEL: Final = "__get_message_type_support_handle__std_msgs__msg__String"
HASH_PREFIX: Final = "RIHS01_"

_Find: Final = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)
_GetHash: Final = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)
_kept: list[Any] = []  # the middleware holds on to all of it as long as the process lives


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("namespace", ctypes.c_char_p),
        ("name", ctypes.c_char_p),
        ("functions", ctypes.c_void_p * 5),
    )


class _TypeSupport(ctypes.Structure):
    _fields_ = (
        ("identifier", ctypes.c_char_p),
        ("data", ctypes.c_void_p),
        ("find", _Find),
        ("get_hash", _GetHash),
        ("get_description", ctypes.c_void_p),
        ("get_sources", ctypes.c_void_p),
    )


def type_support_stub(type_name: str, type_hash: str) -> type:
    """Return a class to subscribe with to raw messages of a type that is not installed.

    Args:
        type_name: full name, for example ``std_msgs/msg/Header``.
        type_hash: as its publishers tell it, RIHS01_...

    Raises:
        InvalidInputError: the middleware is another one, or the hash is no such hash.
    """
    middleware = get_rmw_implementation_identifier()
    if middleware != MIDDLEWARE:
        raise InvalidInputError(f"{type_name} is not installed; {middleware} cannot do without")
    try:
        digest = bytes.fromhex(type_hash.removeprefix(HASH_PREFIX))
        fast, model = _model(FAST), _model(ANY)
    except (ValueError, OSError, AttributeError) as error:
        raise InvalidInputError(f"{type_name} is not installed, and not known ({error})") from error
    if not type_hash.startswith(HASH_PREFIX) or len(digest) != 32:
        raise InvalidInputError(f"{type_name} is not installed, and its hash is {type_hash!r}")
    return _make_class(type_name, digest, fast, model)


def _make_class(type_name: str, digest: bytes, fast: _TypeSupport, model: _TypeSupport) -> type:
    package, kind, name = type_name.split("/")
    callbacks = _Callbacks.from_buffer_copy(ctypes.string_at(fast.data, ctypes.sizeof(_Callbacks)))
    callbacks.namespace, callbacks.name = f"{package}::{kind}".encode(), name.encode()
    support = _TypeSupport.from_buffer_copy(fast)
    hash_ = ctypes.create_string_buffer(b"\x01" + digest, 1 + len(digest))  # with its version

    def find(handle: int, identifier: bytes) -> int | None:
        if identifier == FAST.encode():
            return ctypes.addressof(support)
        found: int | None = model.find(ctypes.addressof(model), identifier)
        return found

    support.data = ctypes.addressof(callbacks)
    support.find = _Find(find)
    support.get_hash = _GetHash(lambda handle: ctypes.addressof(hash_))
    _kept.append((callbacks, support, hash_, fast, model))
    # What rclpy's own classes carry; only the first is looked into for raw messages.
    converters = ("_CREATE_ROS_MESSAGE", "_CONVERT_FROM_PY", "_CONVERT_TO_PY")
    about = dict.fromkeys((*converters, "_DESTROY_ROS_MESSAGE"), _capsule(support))
    metaclass = type(f"Metaclass_{name}", (type,), {"_TYPE_SUPPORT": _capsule(support), **about})
    made: type = metaclass(name, (), {})
    return made


def _model(kind: str) -> _TypeSupport:
    library = ctypes.CDLL(f"libstd_msgs__{kind}.so")
    get = getattr(library, kind + MODEL)
    get.restype = ctypes.POINTER(_TypeSupport)
    found: _TypeSupport = get().contents
    return found


def _capsule(support: _TypeSupport) -> Any:
    new = ctypes.pythonapi.PyCapsule_New
    new.restype = ctypes.py_object
    new.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    return new(ctypes.addressof(support), None, None)
