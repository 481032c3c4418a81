#![no_main]

tactnet_fuzz::target!("hdf5");
