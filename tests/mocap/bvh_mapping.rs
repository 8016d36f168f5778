//! Which joint is which segment, in the dialects seen in the field. The hierarchies are cut down
//! to what the search looks at: names and who carries whom.

use gaitway::body::Segment;
use gaitway::mocap::bvh::{Axis, Bvh, Channel, Joint};
use gaitway::mocap::mapping::{LEGS, Mapping, MappingFile};
use glam::DVec3;

/// A skeleton from indented names; offsets of one unit, so that no joint is a stub.
fn skeleton(outline: &str) -> Bvh {
    let mut joints: Vec<Joint> = Vec::new();
    let mut above: Vec<(usize, usize)> = Vec::new();
    for line in outline.lines().filter(|line| !line.trim().is_empty()) {
        let indent = line.len() - line.trim_start().len();
        above.retain(|(other, _)| *other < indent);
        joints.push(Joint {
            name: line.trim().to_owned(),
            parent: above.last().map(|(_, joint)| *joint),
            offset: DVec3::X,
            channels: vec![Channel::Rotation(Axis::X)],
            first_channel: joints.len(),
            ends: Vec::new(),
        });
        above.push((indent, joints.len() - 1));
    }
    let values = vec![0.0; 2 * joints.len()];
    Bvh { joints, time_step_s: 0.01, values }
}

/// Names of the joints of pelvis, torso, head, arms and legs; for carriers, the joint behind.
fn found(outline: &str) -> Vec<String> {
    let bvh = skeleton(outline);
    let mapping = Mapping::find(&bvh, None).unwrap();
    assert!(mapping.sides_are_named);
    Segment::ALL
        .iter()
        .map(|segment| mapping.part(*segment).map_or("-", |part| &bvh.joints[part.joint].name))
        .map(str::to_owned)
        .collect()
}

fn check(outline: &str, expected: &str) {
    assert_eq!(found(outline).join(", "), expected);
}

#[test]
fn acclaim_with_hip_stubs() {
    check(
        "root
          lhipjoint
            lfemur
              ltibia
                lfoot
                  ltoes
          rhipjoint
            rfemur
              rtibia
                rfoot
                  rtoes
          lowerback
            upperback
              thorax
                lowerneck
                  upperneck
                    head
                lclavicle
                  lhumerus
                    lradius
                      lwrist
                        lhand
                          lfingers
                        lthumb
                rclavicle
                  rhumerus
                    rradius
                      rwrist
                        rhand",
        "root, thorax, head, lhumerus, lradius, rhumerus, rradius, lfemur, ltibia, lfoot, rfemur, \
         rtibia, rfoot",
    );
}

#[test]
fn three_ds_max_biped_with_legs_on_the_spine_and_arms_on_the_neck() {
    check(
        "Bip01
          Bip01 Pelvis
            Bip01 Spine
              Bip01 L Thigh
                Bip01 L Calf
                  Bip01 L Foot
                    Bip01 L Toe0
              Bip01 R Thigh
                Bip01 R Calf
                  Bip01 R Foot
                    Bip01 R Toe0
              Bip01 Spine1
                Bip01 Neck
                  Bip01 Head
                  Bip01 L Clavicle
                    Bip01 L UpperArm
                      Bip01 L Forearm
                        Bip01 L Hand
                  Bip01 R Clavicle
                    Bip01 R UpperArm
                      Bip01 R Forearm
                        Bip01 R Hand",
        "Bip01 Pelvis, Bip01 Spine1, Bip01 Head, Bip01 L UpperArm, Bip01 L Forearm, \
         Bip01 R UpperArm, Bip01 R Forearm, Bip01 L Thigh, Bip01 L Calf, Bip01 L Foot, \
         Bip01 R Thigh, Bip01 R Calf, Bip01 R Foot",
    );
}

#[test]
fn smpl_whose_foot_is_the_toes_and_whose_shoulder_is_the_upper_arm() {
    let outline = "m_avg_Pelvis
          m_avg_L_Hip
            m_avg_L_Knee
              m_avg_L_Ankle
                m_avg_L_Foot
          m_avg_R_Hip
            m_avg_R_Knee
              m_avg_R_Ankle
                m_avg_R_Foot
          m_avg_Spine1
            m_avg_Spine2
              m_avg_Spine3
                m_avg_Neck
                  m_avg_Head
                m_avg_L_Collar
                  m_avg_L_Shoulder
                    m_avg_L_Elbow
                      m_avg_L_Wrist
                        m_avg_L_Hand
                m_avg_R_Collar
                  m_avg_R_Shoulder
                    m_avg_R_Elbow
                      m_avg_R_Wrist
                        m_avg_R_Hand";
    check(
        &outline.replace("m_avg_", ""),
        "Pelvis, Spine3, Head, L_Shoulder, L_Elbow, R_Shoulder, R_Elbow, L_Hip, L_Knee, L_Ankle, \
         R_Hip, R_Knee, R_Ankle",
    );
    let bvh = skeleton(outline);
    let mapping = Mapping::find(&bvh, None).unwrap();
    let foot = mapping.part(LEGS[0][2]).unwrap();
    assert_eq!(bvh.joints[foot.joint].name, "m_avg_L_Ankle");
    assert_eq!(bvh.joints[foot.tip.unwrap().joint].name, "m_avg_L_Foot");
}

#[test]
fn unreal_with_twist_bones_beside_the_chain() {
    check(
        "root
          pelvis
            spine_01
              spine_02
                spine_03
                  clavicle_l
                    upperarm_l
                      upperarm_twist_01_l
                      lowerarm_l
                        lowerarm_twist_01_l
                        hand_l
                          index_01_l
                  clavicle_r
                    upperarm_r
                      lowerarm_r
                        hand_r
                  neck_01
                    head
            thigh_l
              thigh_twist_01_l
              calf_l
                calf_twist_01_l
                foot_l
                  ball_l
            thigh_r
              calf_r
                foot_r
                  ball_r
          ik_foot_root
            ik_foot_l
            ik_foot_r",
        "pelvis, spine_03, head, upperarm_l, lowerarm_l, upperarm_r, lowerarm_r, thigh_l, calf_l, \
         foot_l, thigh_r, calf_r, foot_r",
    );
}

#[test]
fn daz_whose_twist_bones_are_in_the_chain_and_carry_the_segment() {
    let bvh = skeleton(
        "hip
          pelvis
            lThighBend
              lThighTwist
                lShin
                  lFoot
                    lToe
            rThighBend
              rThighTwist
                rShin
                  rFoot
                    rToe
          abdomenLower
            chestUpper
              lCollar
                lShldrBend
                  lShldrTwist
                    lForearmBend
                      lForearmTwist
                        lHand
              rCollar
                rShldrBend
                  rShldrTwist
                    rForearmBend
                      rForearmTwist
                        rHand
              neckLower
                neckUpper
                  head",
    );
    let mapping = Mapping::find(&bvh, None).unwrap();
    for (segment, joint, carrier) in [
        (Segment::LeftThigh, "lThighBend", "lThighTwist"),
        (Segment::LeftShank, "lShin", "lShin"),
        (Segment::RightUpperArm, "rShldrBend", "rShldrTwist"),
        (Segment::RightForearm, "rForearmBend", "rForearmTwist"),
        (Segment::Pelvis, "pelvis", "pelvis"),
        (Segment::Torso, "chestUpper", "chestUpper"),
    ] {
        let part = mapping.part(segment).unwrap();
        assert_eq!(bvh.joints[part.joint].name, joint, "{segment:?}");
        assert_eq!(bvh.joints[part.carrier].name, carrier, "{segment:?}");
    }
}

#[test]
fn xsens_whose_collar_shoulder_elbow_name_the_joints() {
    check(
        "Hips
          Chest
            Chest2
              Neck
                Head
              RightCollar
                RightShoulder
                  RightElbow
                    RightWrist
              LeftCollar
                LeftShoulder
                  LeftElbow
                    LeftWrist
          RightHip
            RightKnee
              RightAnkle
                RightToe
          LeftHip
            LeftKnee
              LeftAnkle
                LeftToe",
        "Hips, Chest2, Head, LeftShoulder, LeftElbow, RightShoulder, RightElbow, LeftHip, \
         LeftKnee, LeftAnkle, RightHip, RightKnee, RightAnkle",
    );
}

#[test]
fn motion_builder_and_unity_and_vrm_names() {
    let outline = "Hips
          LeftUpLeg
            LeftLeg
              LeftFoot
                LeftToeBase
          RightUpLeg
            RightLeg
              RightFoot
          Spine
            Neck
              Head
            LeftShoulder
              LeftArm
                LeftForeArm
                  LeftHand
            RightShoulder
              RightArm
                RightForeArm
                  RightHand";
    let prefixed = outline
        .lines()
        .map(|line| {
            let name = line.trim_start();
            format!("{}Character1_{name}\n", " ".repeat(line.len() - name.len()))
        })
        .collect::<String>();
    let expected = "Hips, Spine, Head, LeftArm, LeftForeArm, RightArm, RightForeArm, LeftUpLeg, \
         LeftLeg, LeftFoot, RightUpLeg, RightLeg, RightFoot";
    check(outline, expected);
    assert_eq!(found(&prefixed).join(", ").replace("Character1_", ""), expected);
    let unity = outline
        .replace("UpLeg", "UpperLeg")
        .replace("LeftLeg", "LeftLowerLeg")
        .replace("RightLeg", "RightLowerLeg")
        .replace("LeftArm", "LeftUpperArm")
        .replace("RightArm", "RightUpperArm")
        .replace("ForeArm", "LowerArm");
    let names = found(&unity);
    assert_eq!(names[3..5], ["LeftUpperArm", "LeftLowerArm"]);
    assert_eq!(names[7..10], ["LeftUpperLeg", "LeftLowerLeg", "LeftFoot"]);
}

#[test]
fn a_mapping_file_means_one_joint_by_a_name_and_gives_it_to_one_segment() {
    let person = skeleton(
        "Base
          LeftThigh
            LeftShin
              LeftFoot
          RightThigh
            RightShin
              RightFoot
          Spine
            Spine",
    );
    let with = |lines: &str| {
        let file = MappingFile::parse(&format!("[segments]\n{lines}")).expect("a mapping file");
        Mapping::find(&person, Some(&file)).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(with("left_thigh = \"LeftThigh\""), Ok(()));
    assert_eq!(with("pelvis = \"Base\"\ntorso = \"Base\""), Ok(()), "no spine of its own");
    let said = with("left_foot = \"LeftFoot\"\nright_foot = \"LeftFoot\"").expect_err("twice");
    assert!(said.contains("LeftFoot: left_foot and right_foot"), "{said}");
    let said = with("torso = \"Spine\"").expect_err("two of that name");
    assert!(said.contains("Spine: joint 8 and joint 9"), "{said}");
}
