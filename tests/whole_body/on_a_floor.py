"""A robot's public model in MuJoCo, with position servos, on a floor. It meets the floor and not itself."""

import mujoco


def model_of(path, stiffness=None, friction=1.0, mass=1.0, added=lambda spec: None):
    """The model, with what is `added` to its description. `stiffness`: of its servos, N m/rad; none: as it has them. `mass`: a factor."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.worldbody.add_geom(name="level", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    added(spec)
    model = spec.compile()
    level = model.geom("level").id
    for geom in range(model.ngeom):
        model.geom_friction[geom, 0] = friction
        if geom != level and (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            model.geom_contype[geom], model.geom_conaffinity[geom] = 0, 1
    model.geom_contype[level] = model.geom_conaffinity[level] = 1
    if stiffness:
        model.actuator_gainprm[:, 0], model.actuator_biasprm[:, 1] = stiffness, -stiffness
    model.body_mass[:] *= mass
    model.body_inertia[:] *= mass
    model.opt.timestep = 0.002
    return model
