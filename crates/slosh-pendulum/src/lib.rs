//! Fuel slosh as a pendulum on a massless universal joint, an appendage for ff-model
