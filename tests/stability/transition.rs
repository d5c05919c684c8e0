//! The matrix of one period of the sampled loop, and what follows from it: how fast errors fade, and what noise
//! of the sensors makes of them. Written from the recurrence, not from the polynomial that the library uses.

use hexad::analysis::sampled_loop::SampledLoop;
use nalgebra::{DMatrix, DVector, RowDVector};

pub struct Transition {
    /// Of `[e, T e', s, u_k-1, u_k-2, ...]`, lengths and T^2 times accelerations.
    matrix: DMatrix<f64>,
    /// What T^2 times an acceleration commanded beside the law adds.
    command: DVector<f64>,
    /// What noise of e, and of T e', in the measurement adds.
    noise: [DVector<f64>; 2],
}

impl Transition {
    pub fn new(of: &SampledLoop) -> Self {
        let SampledLoop { wn_t, damping_ratio, observer, delay, mass_ratio } = *of;
        let (d, f) = (delay.floor() as usize, delay.fract());
        let h = 1.0 - f;
        let states = 4 + d;
        let (kp, kd, l) = (wn_t * wn_t, 2.0 * damping_ratio * wn_t, observer * wn_t);
        let (summed, kp, kd) = (l * kp, kp + l * kd, kd + l);
        let mut law = RowDVector::zeros(states);
        (law[0], law[1], law[2]) = (kp, kd, 1.0);
        // The command of so many periods ago, as a row over the state.
        let command = |ago: usize| {
            let mut row = RowDVector::zeros(states);
            row[2 + ago] = 1.0;
            if ago == 0 { law.clone() } else { row }
        };
        let (newer, older) = (command(d) / mass_ratio, command(d + 1) / mass_ratio);
        let mut matrix = DMatrix::identity(states, states);
        matrix[(0, 1)] = 1.0;
        matrix[(2, 0)] = summed;
        if observer == 0.0 {
            matrix[(2, 2)] = 0.0;
        }
        let mut add = |row: usize, terms: RowDVector<f64>| {
            let sum = matrix.row(row) + terms;
            matrix.set_row(row, &sum);
        };
        add(0, &newer * (-0.5 * h * h) + &older * (-0.5 * (1.0 - h * h)));
        add(1, &newer * -h + &older * -f);
        for ago in 1..=d + 1 {
            matrix.set_row(2 + ago, &command(ago - 1));
        }
        let mut command = DVector::zeros(states);
        command[3] = 1.0;
        if d == 0 {
            (command[0], command[1]) = (-0.5 * h * h / mass_ratio, -h / mass_ratio);
        }
        let mut noise = [kp, kd].map(|gain| &command * gain);
        noise[0][2] += summed;
        Self { matrix, command, noise }
    }

    /// What the slowest part of an error is multiplied with in a cycle.
    pub fn spectral_radius(&self) -> f64 {
        self.matrix.complex_eigenvalues().iter().map(|z| z.norm()).fold(0.0, f64::max)
    }

    /// The error e of so many cycles, from rest, where in the first T^2 times an acceleration is commanded beside
    /// the law.
    pub fn response(&self, push: f64, cycles: usize) -> Vec<f64> {
        let mut state = DVector::zeros(self.matrix.nrows());
        let mut errors = vec![];
        for cycle in 0..cycles {
            errors.push(state[0]);
            state = &self.matrix * state;
            if cycle == 0 {
                state += &self.command * push;
            }
        }
        errors
    }

    /// Standard deviation of e where these are those of the readings of e and T e': P = A P A' + Q, by doubling.
    pub fn deviation(&self, of_noise: [f64; 2]) -> f64 {
        let mut a = self.matrix.clone();
        let mut p = DMatrix::zeros(a.nrows(), a.nrows());
        for (column, deviation) in self.noise.iter().zip(of_noise) {
            p += column * column.transpose() * deviation.powi(2);
        }
        for _ in 0..40 {
            p += &a * &p * a.transpose();
            a = &a * &a;
        }
        p[(0, 0)].sqrt()
    }
}
