//! Surfaces of triangles, as files of meshes have them: STL (binary or text,
//! <https://www.loc.gov/preservation/digital/formats/fdd/fdd000504.shtml>) and OBJ
//! (<https://www.loc.gov/preservation/digital/formats/fdd/fdd000507.shtml>).

use crate::rigid::Placement;
use glam::{DVec3, IVec3};
use std::collections::{HashMap, HashSet};

/// Most corners of a surface, and three times most of its triangles.
const CORNERS_MAX: usize = 6_000_000;
/// Most corners of a face.
const FACE_MAX: usize = 10_000;
/// Lengths that are no robot's, m: cells of a surface are counted from zero.
const FAR_M: f64 = 1e4;
/// Cells are no smaller, m.
const LEAST_CELL_M: f64 = 1e-5;

/// Triangles between points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Corners, in the unit of whoever made it.
    pub points_m: Vec<DVec3>,
    /// Three corners each, against the clock as seen from outside. A file of points alone has none.
    pub triangles: Vec<[usize; 3]>,
}

impl Surface {
    /// What stands in a file; nothing if it is neither STL nor OBJ, or has no points.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let found = binary(bytes).or_else(|| text(bytes))?;
        let sound = !found.points_m.is_empty() && found.points_m.iter().all(|at| at.is_finite());
        sound.then_some(found)
    }

    /// Stretched along its own axes, then put somewhere.
    #[must_use]
    pub fn placed(mut self, scale: DVec3, at: Placement) -> Self {
        for point in &mut self.points_m {
            *point = at.point(*point * scale);
        }
        // A mirror turns the outside in.
        if scale.element_product() < 0.0 {
            self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        self
    }

    /// Adds another.
    pub fn join(&mut self, other: Self) {
        let begin = self.points_m.len();
        self.points_m.extend(other.points_m);
        let moved = other.triangles.into_iter().map(|of| of.map(|corner| corner + begin));
        self.triangles.extend(moved);
    }

    /// With one corner for all that share a cell of a grid, where they are on average; triangles that have less than
    /// three such corners fall away. J. Rossignac and P. Borrel, "Multi-resolution 3D approximations for rendering
    /// complex scenes", in Modeling in Computer Graphics, 1993.
    #[must_use]
    pub fn coarser(&self, cell_m: f64) -> Self {
        let cell_m = cell_m.max(LEAST_CELL_M);
        let cell = |at: &DVec3| -> IVec3 {
            (at.clamp(DVec3::splat(-FAR_M), DVec3::splat(FAR_M)) / cell_m).floor().as_ivec3()
        };
        let mut sums: HashMap<[i32; 3], (DVec3, f64)> = HashMap::new();
        for point in &self.points_m {
            let (sum, count) = sums.entry(cell(point).to_array()).or_default();
            (*sum, *count) = (*sum + *point, *count + 1.0);
        }
        let mut found = Self::default();
        let mut index_of: HashMap<[i32; 3], usize> = HashMap::new();
        let mut known = HashSet::new();
        for triangle in &self.triangles {
            let cells = triangle.map(|corner| cell(&self.points_m[corner]).to_array());
            if cells[0] == cells[1] || cells[1] == cells[2] || cells[2] == cells[0] {
                continue;
            }
            let corners = cells.map(|cell| {
                *index_of.entry(cell).or_insert_with(|| {
                    let (sum, count) = sums[&cell];
                    found.points_m.push(sum / count);
                    found.points_m.len() - 1
                })
            });
            // The same in the same sense, whichever corner comes first.
            let first = (0..3).min_by_key(|at| corners[*at]).unwrap_or(0);
            let turned = [0, 1, 2].map(|at| corners[(first + at) % 3]);
            if known.insert(turned) {
                found.triangles.push(turned);
            }
        }
        found
    }
}

/// Surfaces that have as many triangles as `most` together, or fewer: as fine as that leaves them, all alike. `size_m`
/// is how large they are together.
#[must_use]
pub fn coarse(surfaces: &[Surface], size_m: f64, most: usize) -> Vec<Surface> {
    // What is the same corner to a tenth of a millimetre of half a metre is one from the first.
    let mut cell_m = size_m * 2e-4;
    let mut found: Vec<Surface> = surfaces.iter().map(|one| one.coarser(cell_m)).collect();
    while found.iter().map(|one| one.triangles.len()).sum::<usize>() > most {
        cell_m *= 1.3;
        // Of what is coarse already: millions of triangles are looked at once.
        found.iter_mut().for_each(|one| *one = one.coarser(cell_m));
    }
    found
}

/// Binary STL: 80 bytes, a count, then 50 bytes a triangle, of which 12 are its normal.
fn binary(bytes: &[u8]) -> Option<Surface> {
    let count = u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?) as usize;
    if bytes.len() != count.checked_mul(50)?.checked_add(84)? || 3 * count > CORNERS_MAX {
        return None;
    }
    let value = |four: &[u8]| f64::from(f32::from_le_bytes(four.try_into().unwrap_or_default()));
    let corner =
        |twelve: &[u8]| DVec3::new(value(&twelve[..4]), value(&twelve[4..8]), value(&twelve[8..]));
    let triangles = bytes[84..].chunks_exact(50);
    let points_m =
        triangles.flat_map(|triangle| triangle[12..48].chunks_exact(12).map(corner)).collect();
    Some(in_threes(points_m))
}

/// Points of which three and three are a triangle.
fn in_threes(points_m: Vec<DVec3>) -> Surface {
    let triangles = (0..points_m.len() / 3).map(|at| [3 * at, 3 * at + 1, 3 * at + 2]).collect();
    Surface { points_m, triangles }
}

/// Lines that begin with `vertex` (STL, three of them a triangle), or with `v` (OBJ) and `f`, which names points.
fn text(bytes: &[u8]) -> Option<Surface> {
    let text = std::str::from_utf8(bytes).ok()?;
    let mut found = Surface::default();
    let mut is_stl = false;
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some(word @ ("vertex" | "v")) => {
                is_stl |= word == "vertex";
                let mut next = || words.next().and_then(|word| word.parse::<f64>().ok());
                found.points_m.push(DVec3::new(next()?, next()?, next()?));
            }
            Some("f") => {
                let count = found.points_m.len();
                let corners: Option<Vec<usize>> =
                    words.take(FACE_MAX + 1).map(|word| named(word, count)).collect();
                // A face of more corners is a fan.
                let corners = corners.filter(|corners| corners.len() <= FACE_MAX)?;
                let fan = corners.windows(2).skip(1).map(|two| [corners[0], two[0], two[1]]);
                found.triangles.extend(fan);
            }
            _ => {}
        }
        if found.points_m.len() > CORNERS_MAX || 3 * found.triangles.len() > CORNERS_MAX {
            return None;
        }
    }
    Some(if is_stl { in_threes(found.points_m) } else { found })
}

/// The point that a corner of a face names, counted from 1, or back from the last: `7`, `7/1`, `7/1/3`, `7//3`, `-1`.
fn named(word: &str, count: usize) -> Option<usize> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let count = i64::try_from(count).ok()?;
    let at = if number < 0 { count.checked_add(number)? } else { number - 1 };
    (0..count).contains(&at).then(|| usize::try_from(at).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// Six faces of a cube of 1 m, each cut `n` times along both of its sides.
    fn cube(n: usize) -> Surface {
        let mut found = Surface::default();
        for axis in 0..3 {
            for high in [0.0, 1.0] {
                let at = |a: usize, b: usize| {
                    let mut point = DVec3::ZERO;
                    point[axis] = high;
                    point[(axis + 1) % 3] = a as f64 / n as f64;
                    point[(axis + 2) % 3] = b as f64 / n as f64;
                    point
                };
                for a in 0..n {
                    for b in 0..n {
                        let mut four = [at(a, b), at(a + 1, b), at(a + 1, b + 1), at(a, b + 1)];
                        if high == 0.0 {
                            four.reverse();
                        }
                        let begin = found.points_m.len();
                        found.points_m.extend(four);
                        found.triangles.push([begin, begin + 1, begin + 2]);
                        found.triangles.push([begin, begin + 2, begin + 3]);
                    }
                }
            }
        }
        found
    }

    /// By the divergence theorem: a sixth of the sum of triple products.
    fn volume_m3(of: &Surface) -> f64 {
        let triple = |[a, b, c]: &[usize; 3]| {
            of.points_m[*a].dot(of.points_m[*b].cross(of.points_m[*c])) / 6.0
        };
        of.triangles.iter().map(triple).sum()
    }

    #[test]
    fn the_same_triangle_is_read_from_binary_and_text_stl_and_from_obj() {
        let corners = [[0.5_f32, 0.25, 0.0], [1.0, 0.0, -2.0], [0.0, 4.0, 0.125]];
        let mut binary = vec![0; 80];
        binary.extend(1_u32.to_le_bytes());
        let normal = [0.0_f32; 3];
        for value in normal.iter().chain(corners.iter().flatten()) {
            binary.extend(value.to_le_bytes());
        }
        binary.extend([0, 0]);
        let lines = |word: &str| -> String {
            corners.iter().map(|[x, y, z]| format!("{word} {x} {y} {z}\n")).collect()
        };
        let stl = format!(
            "solid s\nfacet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n",
            lines("vertex")
        );
        for faces in ["f 1 2 3", "f 1/1 2/2 3/3", "f -3//1 -2//1 -1//1"] {
            let obj = Surface::read(format!("o s\n{}{faces}\n", lines("v")).as_bytes()).unwrap();
            assert_eq!(Surface::read(&binary).unwrap(), obj);
            assert_eq!(Surface::read(stl.as_bytes()).unwrap(), obj);
        }
        for outside in ["f 1 2 4", "f 0 1 2", "f -4 1 2", "f 1 2 x", "f 9223372036854775807 1 2"] {
            let text = format!("{}{outside}\n", lines("v"));
            assert_eq!(Surface::read(text.as_bytes()), None, "{outside}");
        }
        // Four corners are two triangles.
        let four = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
        assert_eq!(Surface::read(four.as_bytes()).unwrap().triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_coarser_cube_has_its_corners_in_common_and_holds_as_much() {
        let fine = cube(20);
        assert!((volume_m3(&fine) - 1.0).abs() < 1e-9);
        let joined = fine.coarser(1e-4);
        // Euler: of n² squares on each of six faces there are 6 n² + 2 corners.
        assert_eq!((joined.points_m.len(), joined.triangles.len()), (2_402, 4_800));
        assert!((volume_m3(&joined) - 1.0).abs() < 1e-9);
        let coarse = super::coarse(std::slice::from_ref(&fine), 1.0, 500).remove(0);
        assert!((100..=500).contains(&coarse.triangles.len()), "{}", coarse.triangles.len());
        // Corners go inwards by less than half a cell.
        assert!((0.6..1.0).contains(&volume_m3(&coarse)), "{}", volume_m3(&coarse));
    }

    #[test]
    fn a_mirrored_surface_has_its_outside_outside() {
        let at = Placement { at_m: DVec3::new(3.0, -1.0, 2.0), turn: DQuat::from_rotation_x(0.7) };
        let mirrored = cube(2).placed(DVec3::new(2.0, -1.0, 1.0), at);
        assert!((volume_m3(&mirrored) - 2.0).abs() < 1e-9);
        let mut two = cube(1);
        two.join(cube(1).placed(DVec3::ONE, Placement::at(DVec3::X * 5.0)));
        assert!((volume_m3(&two) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn a_surface_of_nothing_or_far_away_ends() {
        assert_eq!(super::coarse(&[Surface::default()], 0.0, 0), [Surface::default()]);
        let far = Surface {
            points_m: vec![DVec3::ZERO, DVec3::X * 1e300, DVec3::Y * 1e300],
            triangles: vec![[0, 1, 2]],
        };
        assert!(super::coarse(&[far], 1e300, 10)[0].triangles.len() <= 1);
    }
}
