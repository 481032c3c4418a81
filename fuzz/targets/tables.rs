#![no_main]

tactnet_fuzz::target!("tables");
