//! Excitation trajectories: B-splines, limits that hold for all time, costs and an optimiser
