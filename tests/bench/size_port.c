#include "size_port.h"

static volatile uint8_t port;

bool port_take(void *what, size_t length)
{
    uint8_t *const to = what;
    for (size_t i = 0U; i < length; i++) {
        to[i] = port;
    }
    return port != 0U;
}

void port_give(const void *what, size_t length)
{
    const uint8_t *const from = what;
    for (size_t i = 0U; i < length; i++) {
        port = from[i];
    }
}
