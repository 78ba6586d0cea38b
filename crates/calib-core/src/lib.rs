//! Frame graph, loop closures, parameters, the estimation problem and its solution.
