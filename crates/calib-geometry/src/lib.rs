//! SE(3), twists, lines and screw axes, rotation means and the decompositions that everything trusts.
