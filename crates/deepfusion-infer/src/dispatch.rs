//! The choice of an instruction set at run time.

use pulp::{Arch, WithSimd};

/// Runs `work` with the widest instructions that the processor has.
#[cfg(not(test))]
pub(crate) fn dispatch<W: WithSimd>(work: W) -> W::Output {
    Arch::new().dispatch(work)
}

/// In tests: with those set for the thread.
#[cfg(test)]
pub(crate) fn dispatch<W: WithSimd>(work: W) -> W::Output {
    use pulp::Simd;
    match tests::LEVEL.get() {
        tests::Level::Widest => Arch::new().dispatch(work),
        tests::Level::Scalar => pulp::Scalar.vectorize(work),
        #[cfg(target_arch = "x86_64")]
        tests::Level::Avx2 => match pulp::x86::V3::try_new() {
            Some(simd) => Simd::vectorize(simd, work),
            None => Arch::new().dispatch(work),
        },
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::cell::Cell;

    thread_local! {
        pub(crate) static LEVEL: Cell<Level> = const { Cell::new(Level::Widest) };
    }

    /// Instruction sets.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub(crate) enum Level {
        Widest,
        Scalar,
        #[cfg(target_arch = "x86_64")]
        Avx2,
    }

    /// Runs `work` on threads that use this instruction set.
    pub(crate) fn with_level<R: Send>(level: Level, work: impl FnOnce() -> R + Send) -> R {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2);
        let pool = pool.start_handler(move |_| LEVEL.set(level));
        pool.build().unwrap().install(work)
    }
}
