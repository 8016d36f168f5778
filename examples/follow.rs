//! Lets a robot follow goals of one's own: its head nods for four seconds, and the rest stays where it
//! is. The function runs on a thread of its own; the loop never waits for it on a real robot.

use gaitway::{FollowOptions, Moment, Outcome};

pub(crate) fn main() -> Result<(), gaitway::Error> {
    let mut rig = gaitway::open("op3", "sim")?;
    let head = rig.robot().joint_names().iter().position(|name| name == "head_tilt");
    let head = head.ok_or_else(|| gaitway::Error::new("this robot has no such head"))?;
    let mut start_rad = None;
    let nod = move |now: &Moment| {
        let start_rad = start_rad.get_or_insert_with(|| now.goal_rad.clone());
        let mut goals_rad = start_rad.clone();
        goals_rad[head] += 0.2 * (3.0 * now.time_s).sin();
        (now.time_s < 4.0).then_some(goals_rad)
    };
    let report = rig.follow(nod, FollowOptions::default())?;
    assert_eq!(report.run.outcome, Outcome::Done, "{:?}", report.run.stop_reason);
    let joint = &report.run.joints[head];
    println!("{} moved at up to {:.2} rad/s", joint.name, joint.peak_velocity_rad_s);
    Ok(())
}
