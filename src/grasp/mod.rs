//! The force with which a gripper may lift the object without slip or damage.
