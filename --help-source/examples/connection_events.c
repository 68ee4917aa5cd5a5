/* Print the connection events of a robot, a line of JSON each: zenoh-pico and nothing else (docs/other-languages.md).

       cc examples/connection_events.c -DZENOH_LINUX -lzenohpico -o events
       ./events tcp/127.0.0.1:7447       # where a router or `engage up` listens
*/
#include <stdio.h>
#include <unistd.h>
#include <zenoh-pico.h>

static void print_event(z_loaned_sample_t *sample, void *context) {
    (void)context;
    z_owned_string_t json;
    z_bytes_to_string(z_sample_payload(sample), &json);
    printf("%.*s\n", (int)z_string_len(z_loan(json)), z_string_data(z_loan(json)));
    z_drop(z_move(json));
}

int main(int count, char **words) {
    const char *endpoint = count > 1 ? words[1] : "tcp/127.0.0.1:7447";
    z_owned_config_t config;
    z_config_default(&config);
    zp_config_insert(z_loan_mut(config), Z_CONFIG_MODE_KEY, "client");
    zp_config_insert(z_loan_mut(config), Z_CONFIG_CONNECT_KEY, endpoint);
    z_owned_session_t session;
    if (z_open(&session, z_move(config), NULL) < 0) return fprintf(stderr, "nobody listens at %s\n", endpoint), 1;
    setvbuf(stdout, NULL, _IOLBF, 0);
    z_view_keyexpr_t key;
    z_view_keyexpr_from_str(&key, "robot/engage/v1/evt/recognition/connection_event/**");
    z_owned_closure_sample_t closure;
    z_closure(&closure, print_event, NULL, NULL);
    z_owned_subscriber_t subscriber;
    if (z_declare_subscriber(z_loan(session), &subscriber, z_loan(key), z_move(closure), NULL) < 0) return 1;
    puts("connected");
    while (!z_session_is_closed(z_loan(session))) sleep(1);
    return fprintf(stderr, "the connection was lost\n"), 1;
}
