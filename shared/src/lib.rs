//! inekf-shared
