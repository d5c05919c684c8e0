#![allow(unsafe_code, clippy::unwrap_used, clippy::indexing_slicing)]
use hexad::host::config::Config;
use hexad::model::{active_forces::InverseDynamics, leg::Exact, rigid::Motion, task::TaskState};
use std::arch::x86_64::_mm_lfence;
use std::hint::black_box;
fn now() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut t) };
    t.tv_sec as f64 * 1e9 + t.tv_nsec as f64
}
fn main() {
    let text = std::fs::read_to_string("tests/data/motion_base.csv").unwrap();
    let mut machine = Config::load(std::path::Path::new("config/motion_base.toml")).unwrap().machine;
    let motions: Vec<Motion> = text
        .lines()
        .skip(1)
        .map(|l| {
            let v: Vec<f64> = l.trim().split(',').map(|x| x.parse().unwrap()).collect();
            let mut s = TaskState::default();
            for k in 0..6 {
                s.x[k] = v[1 + k];
                s.xd[k] = v[7 + k];
                s.xdd[k] = v[13 + k];
            }
            s.motion()
        })
        .collect();
    if std::env::args().any(|a| a == "--count") {
        let model = InverseDynamics::new(&machine);
        for _ in 0..100 {
            for m in &motions {
                black_box(model.forces::<Exact>(black_box(m)));
            }
        }
        return;
    }
    for level in ["best", "avx2", "base"] {
        machine.level = match level {
            "avx2" => fearless_simd::Level::new().as_avx2().map(fearless_simd::Level::Avx2).unwrap(),
            "base" => fearless_simd::Level::baseline(),
            _ => fearless_simd::Level::new(),
        };
        let model = InverseDynamics::new(&machine);
        let mut a = vec![];
        let mut b = vec![];
        for _ in 0..201 {
            let t = now();
            for _ in 0..50 {
                for m in &motions {
                    black_box(model.forces::<Exact>(black_box(m)));
                }
            }
            a.push((now() - t) / 50.0 / motions.len() as f64);
            let t = now();
            for _ in 0..50 {
                for m in &motions {
                    black_box(model.forces::<Exact>(black_box(m)));
                    unsafe { _mm_lfence() };
                }
            }
            b.push((now() - t) / 50.0 / motions.len() as f64);
        }
        a.sort_by(f64::total_cmp);
        b.sort_by(f64::total_cmp);
        println!("{level}: {:.1} ns throughput (min {:.1}), {:.1} ns isolated", a[100], a[0], b[100]);
    }
}
