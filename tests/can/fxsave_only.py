"""Runs a program that is told that ptrace knows no extended processor state.

User-mode Linux 6.1 has room for 2.5 KiB of it. Processors with AMX have 11 KiB, which the host's
kernel wants back whole, so that every program in the guest dies. Without it, user-mode Linux keeps
the state up to SSE, and programs in the guest must leave AVX alone (GLIBC_TUNABLES).
"""

import ctypes
import os
import struct
import sys

# linux/prctl.h, linux/seccomp.h, linux/filter.h
PR_SET_NO_NEW_PRIVS, PR_SET_SECCOMP, SECCOMP_MODE_FILTER = 38, 22, 2
LOAD, JUMP_IF_EQUAL, RETURN = 0x20, 0x15, 0x06
ALLOW, EINVAL = 0x7FFF0000, 0x00050000 | 22
# Offsets in struct seccomp_data.
SYSCALL, REQUEST, KIND = 0, 16, 32
PTRACE, PTRACE_GETREGSET, NT_X86_XSTATE = 101, 0x4204, 0x202

FILTER = [
    (LOAD, 0, 0, SYSCALL),
    (JUMP_IF_EQUAL, 0, 5, PTRACE),
    (LOAD, 0, 0, REQUEST),
    (JUMP_IF_EQUAL, 0, 3, PTRACE_GETREGSET),
    (LOAD, 0, 0, KIND),
    (JUMP_IF_EQUAL, 0, 1, NT_X86_XSTATE),
    (RETURN, 0, 0, EINVAL),
    (RETURN, 0, 0, ALLOW),
]


class Program(ctypes.Structure):
    _fields_ = [("length", ctypes.c_ushort), ("filter", ctypes.c_char_p)]


def prctl(*arguments):
    if ctypes.CDLL(None, use_errno=True).prctl(*arguments, 0, 0) != 0:
        sys.exit(f"prctl: {os.strerror(ctypes.get_errno())}")


code = b"".join(struct.pack("HBBI", *line) for line in FILTER)
program = Program(len(FILTER), code)
prctl(PR_SET_NO_NEW_PRIVS, ctypes.c_ulong(1), ctypes.c_ulong(0))
prctl(PR_SET_SECCOMP, ctypes.c_ulong(SECCOMP_MODE_FILTER), ctypes.byref(program))
os.execv(sys.argv[1], sys.argv[1:])
