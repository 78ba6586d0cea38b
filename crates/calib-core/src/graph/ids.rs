//! Typed indices into a [`Problem`](crate::Problem): an edge's id cannot index frames.

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
        pub struct $name(pub(crate) u32);

        impl $name {
            pub(crate) fn of(index: usize) -> Self {
                Self(u32::try_from(index).unwrap_or(u32::MAX))
            }

            /// Position in the order of creation.
            #[must_use]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

id!(
    /// A frame: a node of the graph.
    FrameId
);
id!(
    /// An edge `parent_from_child` of the graph.
    EdgeId
);
id!(
    /// A point that is fixed in a frame: a marker on its body, a tool tip.
    PointId
);
id!(
    /// One scalar unknown (or one that could be: it may be held fixed).
    ParameterId
);
id!(
    /// A noise level that several measurements share.
    GroupId
);
id!(
    /// A measurement: one kind of observation along one path.
    MeasurementId
);
