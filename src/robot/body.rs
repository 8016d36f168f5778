//! What a robot weighs and takes up: its file's body as a tree of links.

use crate::error::{Error, ErrorKind};
use crate::rigid::{
    Capsule, Coupling, Cuboid, Drive, JointKind, Mass, Placement, Tree, TreeLink, Volume,
};
use gaitway_profiles::{self as profiles, BaseKind};
use glam::{DMat3, DQuat, DVec3};

/// A robot as a tree of bodies. Link 0 is the base, link n + 1 hangs on the robot's joint n; behind
/// them are links on coupled joints.
#[derive(Clone, Debug)]
pub struct RobotBody {
    /// Links, joints and what they weigh.
    pub tree: Tree,
    /// Whether the base is free.
    pub base: BaseKind,
    /// What each link takes up, in its own axes.
    pub volumes: Vec<Vec<Volume>>,
    /// What it stands on.
    pub soles: Vec<Sole>,
    /// How the servo of each of the robot's joints pulls, if its file says so.
    pub drives: Option<Vec<Drive>>,
    /// How many joints are the robot's own.
    joints: usize,
}

/// What a link stands on.
#[derive(Clone, Debug, PartialEq)]
pub struct Sole {
    /// Index of the link.
    pub link: usize,
    /// Its corners in the link's axes, m.
    pub corners_m: Vec<DVec3>,
    /// Up from it, in the link's axes.
    pub normal: DVec3,
}

/// A sole that is so much further from the floor than the other stands e times less, m.
const STANDS_M: f64 = 0.005;

impl Sole {
    /// Of corners in whatever order; `turn` is that of its link with all joints at zero, when it looks down. Nothing if
    /// they are no plane.
    fn new(link: usize, corners_m: Vec<DVec3>, turn: DQuat) -> Option<Self> {
        let middle = corners_m.iter().sum::<DVec3>() / corners_m.len().max(1) as f64;
        let arms = || corners_m.iter().map(|corner| *corner - middle);
        let normals = arms().flat_map(|one| arms().map(move |two| one.cross(two)));
        let longest = |a: &DVec3, b: &DVec3| a.length_squared().total_cmp(&b.length_squared());
        let normal = normals.max_by(longest)?.try_normalize()?;
        let up = (turn * normal).z.signum();
        Some(Self { link, corners_m, normal: normal * up })
    }
}

impl RobotBody {
    /// The body in a robot's file; nothing if the file has none.
    ///
    /// # Errors
    /// A joint without a place, or numbers that no body has.
    pub fn of(file: &profiles::Robot) -> Result<Option<Self>, Error> {
        file.body.as_ref().map(|body| Self::made(file, body)).transpose()
    }

    /// The joints of a robot's file as a tree without masses and shapes, screwed down; nothing unless every joint
    /// has a place.
    ///
    /// # Errors
    /// As [`RobotBody::of`].
    pub fn bare(file: &profiles::Robot) -> Result<Option<Self>, Error> {
        let is_placed = |joint: &profiles::Joint| joint.origin_m.is_some() && joint.axis.is_some();
        if !file.joints.iter().all(is_placed) {
            return Ok(None);
        }
        let nothing = profiles::Body {
            base: BaseKind::Fixed,
            source: String::new(),
            licence: String::new(),
            shape_source: String::new(),
            links: Vec::new(),
            coupled: Vec::new(),
            servos: None,
            imu: None,
            balance: None,
            when_fallen: profiles::WhenFallen::Hold,
        };
        Self::made(file, &nothing).map(Some)
    }

    fn made(file: &profiles::Robot, body: &profiles::Body) -> Result<Self, Error> {
        let missing = |name: &str| {
            Error::of(ErrorKind::Malformed, "a joint of the body has no place")
                .at(format!("robot {}, joint {name}", file.name))
                .allowed("origin_m and axis, and a parent above it")
        };
        let names: Vec<&str> = file.joints.iter().map(|joint| joint.name.as_str()).collect();
        let names: Vec<&str> =
            names.into_iter().chain(body.coupled.iter().map(|joint| joint.name.as_str())).collect();
        let index = |name: &str| names.iter().position(|known| *known == name).map(|at| at + 1);
        let carried = |parent: &Option<String>, name: &str| match parent {
            Some(parent) => index(parent).ok_or_else(|| missing(name)),
            None => Ok(0),
        };
        let weight =
            |joint: Option<&str>| body.links.iter().find(|link| link.joint.as_deref() == joint);
        let hinge = |name: &str, parent: usize, origin_m: [f64; 3], axis: [f64; 3]| TreeLink {
            name: name.to_owned(),
            parent: Some(parent),
            kind: JointKind::Hinge,
            origin: Placement::at(DVec3::from(origin_m)),
            // To the last digit: a file may have rounded it.
            axis: DVec3::from(axis).normalize_or_zero(),
            anchor_m: DVec3::ZERO,
            mass: weight(Some(name)).map_or(Mass::NONE, mass),
        };
        let mut links = vec![TreeLink {
            name: "base".to_owned(),
            parent: None,
            kind: JointKind::Fixed,
            origin: Placement::IDENTITY,
            axis: DVec3::ZERO,
            anchor_m: DVec3::ZERO,
            mass: weight(None).map_or(Mass::NONE, mass),
        }];
        for joint in &file.joints {
            let (Some(origin_m), Some(axis)) = (joint.origin_m, joint.axis) else {
                return Err(missing(&joint.name));
            };
            let parent = carried(&joint.parent, &joint.name)?;
            links.push(hinge(&joint.name, parent, origin_m, axis));
        }
        let mut couplings = Vec::with_capacity(body.coupled.len());
        for joint in &body.coupled {
            let parent = carried(&joint.parent, &joint.name)?;
            let of = joint
                .of
                .iter()
                .map(|to| Ok((index(&to.joint).ok_or_else(|| missing(&to.joint))?, to.ratio)));
            let of = of.collect::<Result<Vec<_>, Error>>()?;
            couplings.push(Coupling { link: links.len(), of, offset: joint.offset_rad });
            links.push(hinge(&joint.name, parent, joint.origin_m, joint.axis));
        }
        let in_order = std::iter::once(None).chain(names.iter().copied().map(Some));
        let of_links: Vec<Option<&profiles::BodyLink>> = in_order.map(weight).collect();
        let volumes = of_links.iter().map(|link| link.map(volumes).unwrap_or_default()).collect();
        let tree = Tree::new(links, couplings).map_err(|e| match e.place.clone() {
            Some(place) => e.at(format!("robot {}, {place}", file.name)),
            None => e.at(format!("robot {}", file.name)),
        })?;
        let zeros = vec![0.0; tree.moving()];
        let placed = tree.place(Placement::IDENTITY, &tree.coupled(&zeros));
        let soles = of_links.iter().zip(placed).enumerate().filter_map(|(link, (of, placed))| {
            let corners_m = of.as_ref()?.sole_m.as_ref()?;
            Sole::new(link, corners_m.iter().map(|c| DVec3::from(*c)).collect(), placed.turn)
        });
        let soles = soles.collect();
        let drive = |of: profiles::Yielding| Drive {
            stiffness_nm_rad: of.stiffness_nm_rad,
            damping_nm_s_rad: of.damping_nm_s_rad,
            armature_kg_m2: of.armature_kg_m2,
            friction_nm: of.friction_nm,
            torque_nm: of.torque_nm,
        };
        let drives = body
            .servos
            .as_ref()
            .map(|servos| file.joints.iter().map(|joint| drive(servos.of(&joint.name))).collect());
        Ok(Self { tree, base: body.base, volumes, soles, drives, joints: file.joints.len() })
    }

    /// Whether two links are at most two joints apart: one carries the other, or what carries it, or
    /// both hang on the same. What is mounted so is made to fit, and simple shapes of it overlap.
    #[must_use]
    pub fn are_neighbours(&self, one: usize, two: usize) -> bool {
        let above = |link: usize| self.tree.links().get(link).and_then(|link| link.parent);
        let carries = |one: usize, two: usize| {
            above(two) == Some(one) || above(two).and_then(above) == Some(one)
        };
        one == two || carries(one, two) || carries(two, one) || above(one) == above(two)
    }

    /// Which way is up, in the base's axes, for a robot in this pose that stands flat on what it stands on: the soles below
    /// which no other reaches. Nothing for one without soles.
    ///
    /// # Panics
    /// As [`RobotBody::angles`].
    #[must_use]
    pub fn up(&self, joints_rad: &[f64]) -> Option<DVec3> {
        let placed = self.tree.place(Placement::IDENTITY, &self.angles(joints_rad));
        let up = |sole: &Sole| placed[sole.link].turn * sole.normal;
        let lowest_m = |sole: &Sole, up: DVec3| {
            let heights = sole.corners_m.iter().map(|at| placed[sole.link].point(*at).dot(up));
            heights.fold(f64::INFINITY, f64::min)
        };
        let stands = |sole: &Sole| {
            let up = up(sole);
            let own_m = lowest_m(sole, up);
            let lowest_m = self.soles.iter().map(|of| lowest_m(of, up)).fold(own_m, f64::min);
            up * ((lowest_m - own_m) / STANDS_M).exp()
        };
        self.soles.iter().map(stands).sum::<DVec3>().try_normalize()
    }

    /// Angles of all joints of the tree, from those of the robot's joints in its file's order.
    ///
    /// # Panics
    /// If there are not as many as joints of the robot.
    #[must_use]
    pub fn angles(&self, joints_rad: &[f64]) -> Vec<f64> {
        assert_eq!(joints_rad.len(), self.joints, "an angle for every joint of the robot");
        let mut angles = joints_rad.to_vec();
        angles.resize(self.tree.moving(), 0.0);
        self.tree.coupled(&angles)
    }
}

fn mass(link: &profiles::BodyLink) -> Mass {
    let [xx, yy, zz, xy, xz, yz] = link.inertia_kg_m2;
    Mass {
        mass_kg: link.mass_kg,
        centre_m: DVec3::from(link.centre_m),
        inertia_kg_m2: DMat3::from_cols(
            DVec3::new(xx, xy, xz),
            DVec3::new(xy, yy, yz),
            DVec3::new(xz, yz, zz),
        ),
    }
}

fn volumes(link: &profiles::BodyLink) -> Vec<Volume> {
    let capsules = link.capsules.iter().map(|of| {
        Volume::Capsule(Capsule {
            from_m: DVec3::from(of.from_m),
            to_m: DVec3::from(of.to_m),
            radius_m: of.radius_m,
        })
    });
    let boxes = link.boxes.iter().map(|of| {
        let [w, x, y, z] = of.turn;
        Volume::Cuboid(Cuboid {
            centre_m: DVec3::from(of.centre_m),
            turn: DQuat::from_xyzw(x, y, z, w).normalize(),
            half_m: DVec3::from(of.half_m),
        })
    });
    capsules.chain(boxes).collect()
}
