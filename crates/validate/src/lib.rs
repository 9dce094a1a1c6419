//! Is the identified model right: end-effector error and checks of appendages
