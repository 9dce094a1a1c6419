//! The tests as one program: as many programs would compile the same generic dynamics again and again.

mod beam;
mod conformance;
mod mission;
