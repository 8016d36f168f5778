"""MuJoCo's model of a robot's file: its links, and its servos as springs with dampers and friction between goal and joint, on a floor.

For robots without a public model that has servos of its own, or whose model closes chains that the file opens. It meets the floor and not
itself. Soles are small balls at their corners.
"""

import tomllib

import mujoco

SOLE_BALL_M = 0.0005


def text(values):
    return " ".join(f"{value:.9g}" for value in values)


def shapes(link):
    found = []
    for box in link.get("boxes", []):
        turn = box.get("turn", [1.0, 0.0, 0.0, 0.0])
        size, at = text(box["half_m"]), text(box["centre_m"])
        found.append(f'type="box" size="{size}" pos="{at}" quat="{text(turn)}"')
    for capsule in link.get("capsules", []):
        size, ends = capsule["radius_m"], [capsule["from_m"], capsule["to_m"]]
        one = f'fromto="{text(ends[0] + ends[1])}"'
        found.append(f'type="capsule" size="{size}" {one}' if ends[0] != ends[1] else f'type="sphere" size="{size}" pos="{text(ends[0])}"')
    for corner in link.get("sole_m", []):
        found.append(f'type="sphere" size="{SOLE_BALL_M}" pos="{text(corner)}"')
    return "".join(f'<geom {shape} contype="0" conaffinity="1"/>' for shape in found)


def servo(servos, joint):
    others = [other for other in servos.get("other", []) if joint in other["joints"]]
    return others[0] if others else servos


def model_of(path, stiffness=None, friction=1.0, mass=1.0):
    """The model, the names of its feet, and what joints it has. `stiffness`: how many times as stiff its servos are; `mass`: a factor."""
    with open(path, "rb") as file:
        robot = tomllib.load(file)
    body = robot["body"]
    assert not body.get("coupled"), "coupled joints are not built here"
    links = {link.get("joint"): link for link in body["link"]}
    actuators, feet = [], []

    def inside(name):
        link, out = links.get(name), ""
        if link and link["mass_kg"] > 0:
            xx, yy, zz, xy, xz, yz = (mass * value for value in link["inertia_kg_m2"])
            out += f'<inertial pos="{text(link["centre_m"])}" mass="{mass * link["mass_kg"]:.9g}" fullinertia="{text([xx, yy, zz, xy, xz, yz])}"/>'
        elif name is not None:
            out += '<inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/>'
        if link:
            out += shapes(link)
            if "sole_m" in link:
                feet.append(name)
        for joint in robot["joint"]:
            if joint.get("parent") != name:
                continue
            own, called = servo(body["servos"], joint["name"]), joint["name"]
            holds = [own["damping_nm_s_rad"], own.get("friction_nm", 0.0), own["armature_kg_m2"]]
            damping, rubs, armature = map(str, holds)
            out += f'<body name="{called}" pos="{text(joint["origin_m"])}">'
            out += f'<joint name="{called}" axis="{text(joint["axis"])}" damping="{damping}" frictionloss="{rubs}" armature="{armature}"/>'
            out += inside(called) + "</body>"
            kp, most = own["stiffness_nm_rad"] * (stiffness or 1.0), own["torque_nm"]
            actuators.append(f'<position name="{called}" joint="{called}" kp="{kp}" forcerange="{-most} {most}"/>')
        return out

    links_text = inside(None)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><compiler angle="radian" balanceinertia="true"/><option timestep="0.002" integrator="implicitfast"/><worldbody>'
        f'<geom name="level" type="plane" size="0 0 1" contype="1" conaffinity="0"/><body name="base"><freejoint/>{links_text}</body>'
        f'</worldbody><actuator>{"".join(actuators)}</actuator></mujoco>'
    )
    model.geom_friction[:, 0] = friction
    return model, feet
