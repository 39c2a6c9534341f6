//! inekf-client
