//! Decompresses chunks ahead of need, on its own threads.

use crate::buffer::Pool;
use crate::content::{self, ReadableChunk};
use crate::index::ChunkInfo;
use crate::problem::Fault;
use crate::source::Source;
use crossbeam_channel::{Receiver, Sender, bounded, unbounded};
use std::sync::Arc;
use std::thread::{self, JoinHandle};

type Outcome = Result<ReadableChunk, Fault>;

/// A chunk that is being opened, or will be.
pub(crate) enum Ticket {
    /// Opened by a thread, which sends it here.
    Ahead(Receiver<Outcome>),
    /// Opened on demand.
    OnDemand,
}

struct Job {
    info: ChunkInfo,
    done: Sender<Outcome>,
}

/// The threads. They are the iterator's own, not a shared pool's: the iterator waits for them, and a pool whose threads all wait
/// for the pool's own work would deadlock.
pub(crate) struct Ahead {
    source: Arc<Source>,
    limit: usize,
    threads: usize,
    pool: Arc<Pool>,
    /// Both ends of the queue: the second is for withdrawing jobs that are no longer needed.
    queue: Option<(Sender<Job>, Receiver<Job>)>,
    workers: Vec<JoinHandle<()>>,
}

impl Ahead {
    pub(crate) fn new(source: Arc<Source>, limit: usize, threads: usize) -> Self {
        Self {
            source,
            limit,
            threads,
            // As many chunks as are open at once in a bag whose chunks do not overlap in time.
            pool: Pool::new(2 * threads + 2),
            queue: None,
            workers: Vec::new(),
        }
    }

    /// Starts to open a chunk if that takes work; the threads start with the first such chunk.
    pub(crate) fn submit(&mut self, info: &ChunkInfo) -> Ticket {
        if self.threads == 0 || !content::is_compressed(&self.source, info) {
            return Ticket::OnDemand;
        }
        let (done, ticket) = bounded(1);
        let job = Job {
            info: info.clone(),
            done,
        };
        let (jobs, _) = self.queue.get_or_insert_with(|| {
            let (jobs, queue) = unbounded();
            self.workers = (0..self.threads)
                .filter_map(|_| worker(&self.source, &queue, self.limit, &self.pool))
                .collect();
            (jobs, queue)
        });
        // If the system cannot start a thread, chunks are opened on demand.
        if self.workers.is_empty() || jobs.send(job).is_err() {
            Ticket::OnDemand
        } else {
            Ticket::Ahead(ticket)
        }
    }

    /// Waits until the chunk is open.
    pub(crate) fn chunk(&self, ticket: Ticket, info: &ChunkInfo) -> Outcome {
        let outcome = match ticket {
            Ticket::Ahead(ticket) => ticket.recv().ok(),
            Ticket::OnDemand => None,
        };
        outcome.unwrap_or_else(|| content::open(&self.source, info, self.limit, &self.pool))
    }
}

fn worker(
    source: &Arc<Source>,
    queue: &Receiver<Job>,
    limit: usize,
    pool: &Arc<Pool>,
) -> Option<JoinHandle<()>> {
    let (source, queue, pool) = (Arc::clone(source), queue.clone(), Arc::clone(pool));
    let work = move || {
        for job in queue {
            // If the iterator was dropped, no one receives the chunk.
            let _ = job
                .done
                .send(content::open(&source, &job.info, limit, &pool));
        }
    };
    thread::Builder::new()
        .name("bag chunk".to_owned())
        .spawn(work)
        .ok()
}

impl Drop for Ahead {
    fn drop(&mut self) {
        if let Some((_, queue)) = self.queue.take() {
            while queue.try_recv().is_ok() {}
        }
        for worker in self.workers.drain(..) {
            // A panic has already been printed by its thread; its chunk is opened on demand.
            let _ = worker.join();
        }
    }
}
