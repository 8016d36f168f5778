//! Whose figures are used where men and women were measured apart.

/// Whose figures are used where men and women were measured apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sex {
    /// Women's figures.
    Female,
    /// Men's figures.
    Male,
}

/// Body mass over stature squared, kg/m^2: 15 women of 61.9 kg and 1.735 m, 100 men of 73.0 kg and 1.741 m (de
/// Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", Journal of Biomechanics 29, 1996).
const MASS_KG_M2: [f64; 2] = [61.9 / (1.735 * 1.735), 73.0 / (1.741 * 1.741)];

impl Sex {
    /// Of figures for women and men, those that count; the mean of both if it is not known.
    pub(super) const fn of(sex: Option<Self>, [female, male]: [f64; 2]) -> f64 {
        match sex {
            Some(Self::Female) => female,
            Some(Self::Male) => male,
            None => f64::midpoint(female, male),
        }
    }

    /// Mass of a body of this stature and the build of those who were measured, kg.
    pub(super) const fn usual_mass_kg(sex: Option<Self>, stature_m: f64) -> f64 {
        Self::of(sex, MASS_KG_M2) * stature_m * stature_m
    }
}
