//! Files written whole: beside, synchronized, renamed.
