//! Quaternions w, x, y, z as plain arrays.

pub(super) fn times(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

pub(super) fn inverse(q: [f64; 4]) -> [f64; 4] {
    [q[0], -q[1], -q[2], -q[3]]
}

/// Turns a vector.
pub(super) fn forth(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let turned = times(times(q, [0.0, v[0], v[1], v[2]]), inverse(q));
    [turned[1], turned[2], turned[3]]
}

/// Turns a vector the other way.
pub(super) fn back(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    forth(inverse(q), v)
}

pub(super) fn normalised(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    if length > 0.0 { q.map(|c| c / length) } else { [1.0, 0.0, 0.0, 0.0] }
}

/// Of a rotation vector, rad.
pub(super) fn of_vector(v: [f64; 3]) -> [f64; 4] {
    let angle = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let share = if angle > 0.0 { (angle / 2.0).sin() / angle } else { 0.5 };
    [(angle / 2.0).cos(), v[0] * share, v[1] * share, v[2] * share]
}

/// Roll, pitch, yaw, rad: yaw about Z first, then pitch about the new Y, then roll about the new X.
pub(super) fn to_euler([w, x, y, z]: [f64; 4]) -> [f64; 3] {
    [
        (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
        (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
    ]
}
