use super::*;

#[test]
fn nothing_leaves_this_machine_in_plain_text_unless_that_was_asked_for() {
    let check = |network: &str, channel: &str| {
        Table::parse(&format!(
            "bus = \"a\"\n[network]\n{network}\n[channels.a]\npacket = \"u8\"\nitem_bytes = 1\n{channel}"
        ))
        .map_err(|error| error.to_string())
    };
    let keys = "authority = \"a\"\ncertificate = \"b\"\nprivate_key = \"c\"";
    for allowed in [
        "listen = [\"tcp/127.0.0.1:7447\", \"tcp/[::1]:7447\"]\nconnect = [\"tcp/localhost:1\"]"
            .to_owned(),
        "listen = [\"tcp/10.0.0.2:7447\"]\nplain_text = true".into(),
        format!("listen = [\"tls/10.0.0.2:7447\"]\n{keys}"),
    ] {
        check(&allowed, "").unwrap();
    }
    for (refused, why) in [
        ("connect = [\"tcp/10.0.0.2:7447\"]", "without encryption"),
        ("listen = [\"tcp/0.0.0.0:7447\"]", "without encryption"),
        ("listen = [\"udp/[::]:7447\"]", "without encryption"),
        (
            "connect = [\"tcp/localhost.evil.example:7447\"]",
            "without encryption",
        ),
        (
            "listen = [\"tls/10.0.0.2:7447\"]\nauthority = \"a\"",
            "needs `certificate`",
        ),
        (
            &format!("listen = [\"tls/10.0.0.2:7447\"]\nconnect = [\"tcp/127.0.0.1:1\"]\n{keys}"),
            "all endpoints with TLS or none",
        ),
    ] {
        let found = check(refused, "").unwrap_err();
        assert!(found.contains(why), "{refused}: {found}");
    }
    let open = "listen = [\"tcp/127.0.0.1:7447\"]";
    let found = check(open, "put_from = [\"arm\"]").unwrap_err();
    assert!(found.contains("identified by certificates"), "{found}");
}

#[test]
fn a_table_is_what_it_says() {
    let table = Table::new("lab").with("a/b", ChannelConfig::of::<f32>(3));
    assert_eq!(Table::parse(&table.to_toml()).unwrap(), table);
    assert_eq!(table.channel("a/b").unwrap().packet_bytes(), 12);
    let unknown = table.channel("a").unwrap_err().to_string();
    assert_eq!(
        unknown,
        "channel `a` is not in the table; the table contains a/b"
    );
}

#[test]
fn wrong_tables_are_refused_with_the_reason() {
    for (text, reason) in [
        ("bus = \"a b\"\n[channels]", "bus: expected"),
        (
            "bus = \"a\"\n[network]\nhost = \"../x\"\n[channels]",
            "network.host: expected 0 to 24",
        ),
        (
            "bus = \"a\"\n[channels.\"x y\"]\npacket=\"u8\"\nitem_bytes=1",
            "is not a channel id",
        ),
        (
            "bus = \"a\"\n[channels.x]\npacket=\"u8\"\nitem_bytes=0",
            "item_bytes: expected at least 1",
        ),
        (
            "bus = \"a\"\n[channels.x]\npacket=\"u8\"\nitem_bytes=1\nhistory=17",
            "at most its depth, 16",
        ),
        (
            "bus = \"a\"\n[channels.x]\npacket=\"u8\"\nitem_bytes=1\nsize=3",
            "line 5: unknown field `size`",
        ),
    ] {
        let error = Table::parse(text).unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn the_memory_of_a_port_is_known_in_advance() {
    let huge = ChannelConfig {
        item_bytes: 16,
        items: 1 << 60,
        ..ChannelConfig::of::<u8>(1)
    };
    assert!(
        Table::new("a")
            .with("x", huge)
            .check()
            .unwrap_err()
            .contains("64 TiB")
    );
    let channel = ChannelConfig {
        get_ports: 2,
        depth: 3,
        held: 1,
        history: 1,
        ..ChannelConfig::of::<u8>(100)
    };
    assert_eq!(channel.slots(), 2 * 4 + 1 + 1);
    assert_eq!(channel.put_port_bytes(), 10 * (128 + 128));
}
