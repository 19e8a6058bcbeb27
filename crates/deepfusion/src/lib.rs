//! Metric depth from one camera and a speed signal.
