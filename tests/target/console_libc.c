#include "console.h"

#include <stdio.h>

void console_write(const char *text, size_t length)
{
    (void)fwrite(text, 1U, length, stdout);
}
