"""Reports of the command as its JSON has them: the fields that most programs look at."""

from __future__ import annotations

from typing import Any, Dict, List, Optional, TypedDict


class JointReport(TypedDict):
    """One joint of a motion."""

    name: str
    range_rad: Optional[List[float]]
    peak_velocity_rad_s: float
    peak_acceleration_rad_s2: float
    limit_velocity_rad_s: float
    limit_acceleration_rad_s2: float
    tracking_rms_rad: Optional[float]
    clipped_samples: int
    missed_reads: int


class PlayReport(TypedDict):
    """What became of a motion."""

    outcome: str
    stop_reason: Optional[str]
    motion: str
    robot: str
    cycles: int
    missed_cycles: int
    late_cycles: int
    cycle_hz: float
    duration_s: float
    retime_factor: float
    retime_joint: Optional[str]
    joints: List[JointReport]
    recording: Optional[str]
    source: Dict[str, Any]
    referee: Optional[Dict[str, Any]]
    notes: List[str]


#: A motion that was not played has the same fields.
RetargetReport = PlayReport


class RecordReport(TypedDict):
    """What was recorded."""

    file: Optional[str]
    outcome: str
    duration_s: float
    sources: List[Dict[str, Any]]
    messages: int
    dropped: int
