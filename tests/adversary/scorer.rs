//! The scorer sees each violation: a platform that is driven beyond a limit on purpose.
