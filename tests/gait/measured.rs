//! Mean joint angles of people who walk and run, along the stride.
//!
//! Sagittal plane, right leg, from heel contact to heel contact, one value every
//! 5 % of the stride, deg; hip and knee flexion and ankle dorsiflexion are positive. Walking: 51
//! people on a treadmill at a comfortable speed, 1.24 m/s on average (Fukuchi, Fukuchi, Duarte, "A
//! public dataset of overground and treadmill walking kinematics and kinetics in healthy
//! individuals", PeerJ 6:e4640, 2018, data doi 10.6084/m9.figshare.5722711.v6, trials T05). Running:
//! 39 people at 3.5 m/s ("A public dataset of running biomechanics and the effects of running speed
//! on lower extremity kinematics and kinetics", PeerJ 5:e3298, 2017, data doi
//! 10.6084/m9.figshare.4543435.v5). Both are CC BY 4.0; the means over people are those of
//! github.com/azzindani/Carys, digests/gait-motions.

/// What was measured, every 5 % of the stride from contact.
pub struct Measured {
    pub hip_deg: [f64; 20],
    pub knee_deg: [f64; 20],
    pub ankle_deg: [f64; 20],
    /// How far the pelvis, from which the hip is measured, is tipped forward. An action's pelvis is
    /// upright. This much makes the foot lie flat in mid-stance, where hip less knee plus ankle is
    /// the pitch of the foot; a pelvis tips by about as much in gait.
    pub pelvis_deg: f64,
}

pub const WALKING: Measured = Measured {
    hip_deg: [
        31.5, 30.4, 29.6, 25.0, 19.7, 14.6, 9.1, 4.1, 0.1, -3.8, -6.9, -8.0, -5.0, 2.8, 12.6, 21.5,
        28.1, 32.4, 33.9, 32.6,
    ],
    knee_deg: [
        2.6, 8.1, 16.0, 17.1, 15.2, 12.3, 8.7, 5.8, 4.1, 4.1, 7.1, 14.4, 28.3, 46.6, 59.7, 63.0,
        57.4, 44.5, 25.6, 7.2,
    ],
    ankle_deg: [
        1.9, -3.8, -1.3, 3.3, 6.2, 8.1, 9.3, 10.4, 11.6, 12.3, 11.8, 7.9, -3.0, -11.9, -7.1, -0.7,
        4.0, 6.0, 4.4, 1.7,
    ],
    pelvis_deg: 10.0,
};

pub const RUNNING: Measured = Measured {
    hip_deg: [
        38.3, 36.0, 36.0, 32.4, 23.6, 12.6, 1.8, -4.8, -6.3, -4.6, -1.2, 3.6, 12.5, 25.7, 39.0,
        48.1, 52.4, 52.5, 48.6, 42.8,
    ],
    knee_deg: [
        11.8, 22.0, 37.6, 43.9, 40.7, 31.9, 20.7, 13.8, 18.1, 33.2, 53.6, 74.8, 93.6, 105.8, 107.5,
        98.3, 81.2, 58.8, 34.0, 15.2,
    ],
    ankle_deg: [
        4.2, 2.1, 10.1, 19.5, 24.0, 19.6, 4.6, -13.3, -21.3, -20.0, -18.2, -16.4, -12.0, -6.8,
        -2.8, -0.1, 1.1, 2.7, 4.7, 5.3,
    ],
    pelvis_deg: 8.0,
};
