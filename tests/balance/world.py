"""A ROBOTIS OP3 in MuJoCo: its public model on a floor, moved by position servos whose goals come over a line."""

import math
import os
import sys

import mujoco
import numpy as np

from servos import Board, Bus, Servo

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, "whole_body"))
import on_a_floor

COUNTS = 4096 / math.tau
VELOCITY = 0.229 * math.tau / 60  # rad/s of one unit
GRAVITY = 9.81
# What the robot's file and its drafts say: which servo is where, how it stands, how its board is screwed on.
JOINTS = (
    "r_sho_pitch l_sho_pitch r_sho_roll l_sho_roll r_el l_el r_hip_yaw l_hip_yaw r_hip_roll l_hip_roll r_hip_pitch l_hip_pitch "
    "r_knee l_knee r_ank_pitch l_ank_pitch r_ank_roll l_ank_roll head_pan head_tilt"
).split()
STANDS = [15, -15, -45, 45, 45, -45, 0, 0, 0, 0, 60, -60, -120, 120, -60, 60, 0, 0, 0, -10]  # deg
BOARD_AXES = np.array([-1.0, -1.0, 1.0])
FEET = ("l_ank_roll_link", "r_ank_roll_link")
HELD_S = 0.2  # with torque, until somebody lets go
FLOOR_RAD_S = 0.5  # how fast the floor is tilted


def model_of(path, stiffness=None, friction=1.0, mass=1.0, **_):
    """The model, with what its board measures."""

    def sensors(spec):
        for name, kind in (("gyro", mujoco.mjtSensor.mjSENS_GYRO), ("acceleration", mujoco.mjtSensor.mjSENS_ACCELEROMETER)):
            spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="torso")

    return on_a_floor.model_of(path, stiffness, friction, mass, sensors)


class World:
    """The robot, its line, and what befalls it.

    `delay_s` passes until a servo does what it was told. `pushes`: from, until (s since torque was on), ahead, left (N), at the trunk's
    centre of mass. `slope`: from, ahead, left (rad). `seed`: noise of the board (0.2 deg/s, 0.01 g) and 0.01 rad of the joints'
    first angles; none: neither.
    """

    def __init__(self, model, delay_s=0.0, pushes=(), slope=None, seed=None, watch=None, **_):
        self.model, self.data = model, mujoco.MjData(model)
        self.delay_s, self.pushes, self.slope, self.watch = delay_s, list(pushes), slope, watch
        self.random = None if seed is None else np.random.default_rng(seed)
        self.level = model.geom("level").id
        self.trunk = model.jnt_bodyid[0]
        self.feet = [model.body(name).id for name in FEET]
        self.places = [model.joint(name).qposadr[0] for name in JOINTS]
        self.rates = [model.joint(name).dofadr[0] for name in JOINTS]
        driver = {model.actuator_trnid[a, 0]: a for a in range(model.nu)}
        self.drivers = [driver[model.joint(name).id] for name in JOINTS]
        self.now_s = self.let_go_s = 0.0
        self.is_held, self.powered, self.powered_s = True, 0, 0.0
        self.fell_s = self.fell_on = None
        self.ticks, self.waiting = 0, []
        self.slope_rad, self.floor_rad_s = np.zeros(2), np.zeros(3)
        self.servos = [Servo(at + 1, self.measure, self.moved) for at in range(len(JOINTS))]
        self.board = Board(200, self.measure)
        self.bus = Bus([*self.servos, self.board])
        self.put_down()

    def put_down(self):
        """On both soles, as it stands."""
        model, data = self.model, self.data
        angles = np.radians(STANDS)
        if self.random is not None:
            angles = angles + self.random.normal(0, 0.01, len(angles))
        data.qpos[:] = 0
        data.qpos[3] = 1
        data.qpos[self.places] = angles
        mujoco.mj_kinematics(model, data)
        lowest = math.inf
        for geom in range(model.ngeom):
            if model.geom_bodyid[geom] in self.feet:
                turn = data.geom_xmat[geom].reshape(3, 3)
                lowest = min(lowest, data.geom_xpos[geom][2] - np.abs(turn[2]) @ model.geom_size[geom])
        data.qpos[2] = -lowest
        self.gains = model.actuator_gainprm[self.drivers, 0].copy()
        for at, servo in enumerate(self.servos):
            servo.put(63, 1, 56 if at < 6 else 52)  # Shutdown, as OP3's set-up has it for arms and the rest
            servo.put(Servo.GOAL, 4, round(2048 + data.qpos[self.places[at]] * COUNTS))
        mujoco.mj_forward(model, data)

    def moved(self, servo):
        """A servo has a new goal, or its torque was switched."""
        goal = (servo.get(Servo.GOAL, 4, signed=True) - 2048) / COUNTS
        self.waiting.append((self.now_s + self.delay_s, servo.id - 1, goal, bool(servo.memory[Servo.TORQUE])))

    def measure(self, device, address):
        data = self.data
        if device is self.board:
            axis = (address - 32) // 2
            if axis < 3:
                felt = math.degrees(data.sensor("gyro").data[axis] + self.floor_in_trunk()[axis])
                felt += self.random.normal(0, 0.2) if self.random is not None else 0
                felt /= Board.GYRO_DEG_S
            else:
                axis -= 3
                # Who is held is not pulled down.
                held = data.xmat[self.trunk].reshape(3, 3)[2] * GRAVITY
                felt = (held if self.is_held else data.sensor("acceleration").data)[axis] / GRAVITY
                felt += self.random.normal(0, 0.01) if self.random is not None else 0
                felt /= Board.ACCELERATION_G
            return max(-32768, min(32767, round(BOARD_AXES[axis] * felt)))
        at = device.id - 1
        turn, rate, torque = data.qpos[self.places[at]], data.qvel[self.rates[at]], data.actuator_force[self.drivers[at]]
        return {
            120: lambda: int(self.now_s * 1000) % 32768,
            122: lambda: int(abs(rate) > 10 * VELOCITY),
            124: lambda: round(torque / 5 * 885),
            126: lambda: round(torque / 1.78 / 0.00269),
            128: lambda: round(rate / VELOCITY),
            132: lambda: round(2048 + turn * COUNTS),
        }[address]()

    def floor_in_trunk(self):
        """The floor is tilted by turning what pulls; who stands on it feels that he turns."""
        return self.data.xmat[self.trunk].reshape(3, 3).T @ self.floor_rad_s

    def advance(self, to_s):
        """Moves on to the last whole step at or before a time."""
        step_s = self.model.opt.timestep
        while (self.ticks + 1) * step_s <= to_s + 1e-9:
            self.ticks += 1
            self.now_s = self.ticks * step_s
            self.step(step_s)
        self.now_s = max(self.now_s, to_s)

    def step(self, step_s):
        model, data = self.model, self.data
        while self.waiting and self.waiting[0][0] <= self.now_s:
            _, at, goal, has_torque = self.waiting.pop(0)
            data.ctrl[self.drivers[at]] = goal
            gain = self.gains[at] if has_torque else 0.0
            model.actuator_gainprm[self.drivers[at], 0], model.actuator_biasprm[self.drivers[at], 1] = gain, -gain
        if self.is_held:
            powered = sum(servo.memory[Servo.TORQUE] for servo in self.servos)
            if powered != self.powered:
                self.powered, self.powered_s = powered, self.now_s
            elif powered and self.now_s >= self.powered_s + HELD_S - 1e-9:
                self.is_held, self.let_go_s = False, self.now_s
            if self.is_held:
                return
        data.xfrc_applied[self.trunk, :3] = 0
        for from_s, until_s, ahead_n, left_n in self.pushes:
            if from_s <= self.now_s - self.powered_s < until_s:
                data.xfrc_applied[self.trunk, :2] += [ahead_n, left_n]
        if self.slope and self.now_s - self.powered_s >= self.slope[0]:
            before = self.slope_rad.copy()
            self.slope_rad += np.clip(np.array(self.slope[1:]) - self.slope_rad, -FLOOR_RAD_S * step_s, FLOOR_RAD_S * step_s)
            ahead, left = (self.slope_rad - before) / step_s
            self.floor_rad_s[:] = [-left, ahead, 0]
            # What falls ahead pulls ahead.
            down = np.array([math.sin(self.slope_rad[0]), math.sin(self.slope_rad[1]), 0])
            down[2] = -math.sqrt(1 - down @ down)
            model.opt.gravity[:] = GRAVITY * down
        mujoco.mj_step(model, data)
        if self.watch:
            self.watch(self)
        if self.ticks % 5 == 0 and self.fell_s is None:
            met = [a if b == self.level else b for a, b in zip(data.contact.geom1, data.contact.geom2)]
            low = [model.geom_bodyid[geom] for geom in met if model.geom_bodyid[geom] not in self.feet]
            upright = data.xmat[self.trunk][8]
            if low or upright < 0.5:
                self.fell_s = self.now_s - self.powered_s
                self.fell_on = model.body(low[0]).name if low else "tilted by 60 deg"
