//! Flexible solar panels as chains of rigid segments on sprung hinges, an appendage for ff-model
