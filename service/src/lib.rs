//! inekf-service
