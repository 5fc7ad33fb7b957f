#include "board.h"

void hg_board_say_number(uint32_t number)
{
    char digits[11];
    size_t at = sizeof(digits) - 1U;
    uint32_t rest = number;

    digits[at] = '\0';
    do {
        at--;
        digits[at] = (char)('0' + (char)(rest % 10U));
        rest /= 10U;
    } while (rest > 0U);
    hg_board_say(&digits[at]);
}
