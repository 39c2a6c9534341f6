//! Tests of what needs no daemon: datasets, simulation, evaluation, tables and figures.

mod dataset;
mod evaluate;
mod exchange;
mod geodetic;
mod journal;
mod look;
mod meta;
mod models;
mod planar;
mod plot;
mod recordings;
mod simulate;
mod simulated_noise;
mod table;
