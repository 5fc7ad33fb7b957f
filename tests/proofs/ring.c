/** @file
 *  ring.h: the recent past. */
#include "proof.h"

#include "hullguard/linalg.h"
#include "hullguard/ring.h"

/** A ring starts with nothing but zeros; what is pushed is the newest row, every older row stays what it was until it is the oldest, and a row that is not finite changes nothing.
 *  Any width and length up to WIDTH and LENGTH, any numbers, the newest row in any place; one push after any past.
 *  @proves hg_ring_start hg_ring_reset hg_ring_push hg_ring_open hg_ring_row
 *  @run check real=f32 unwind=10 limit=150 WIDTH=3U LENGTH=3U
 *  @run check real=q31 unwind=10 limit=150 WIDTH=3U LENGTH=3U */
void proof_ring_push(void)
{
    hg_real memory[WIDTH * LENGTH];
    hg_real row[WIDTH];
    hg_real before[WIDTH * LENGTH];
    hg_ring self;
    const uint8_t width = any_u8_in(0U, WIDTH);
    const uint8_t length = any_u8_in(0U, LENGTH);
    const uint32_t n = HG_RING_REALS(width, length);
    const hg_status started = hg_ring_start(&self, width, length, TAIL(memory, n));
    prove((started == HG_OK) == ((width > 0U) && (length > 0U)), "no ring without a size");
    prove((hg_ring_start(NULL, width, length, memory) == HG_E_ARGUMENT) && (hg_ring_start(&self, width, length, NULL) == HG_E_ARGUMENT), "null pointers");
    if (started == HG_OK) {
        const uint8_t any = any_u8_in(0U, (uint8_t)(n - 1U));
        prove((self.data[any] >= HG_REAL_ZERO) && (self.data[any] <= HG_REAL_ZERO), "nothing but zeros");
        for (uint32_t i = 0U; i < n; i++) {
            hg_real x;
            assume(hg_real_finite(x));
            self.data[i] = x;
            before[i] = x;
        }
        self.newest = any_u8_in(0U, (uint8_t)(length - 1U));
        const uint8_t was = self.newest;
        const hg_real *next = TAIL(row, width);
        const uint8_t lag = any_u8_in(0U, (uint8_t)(length - 1U));
        const uint8_t g = any_u8_in(0U, (uint8_t)(width - 1U));
        const hg_real held = hg_ring_row(&self, lag)[g];
        const hg_status status = hg_ring_push(&self, next);
        prove((status == HG_OK) == hg_linalg_finite(next, width), "only what is finite");
        if (status == HG_OK) {
            prove(self.newest == ((was + 1U) % length), "the next place");
            prove((hg_ring_row(&self, 0U)[g] >= next[g]) && (hg_ring_row(&self, 0U)[g] <= next[g]), "the newest row");
            if ((lag + 1U) < length) {
                const hg_real later = hg_ring_row(&self, (uint8_t)(lag + 1U))[g];
                prove((later >= held) && (later <= held), "one sample older");
                reach("an older row");
            }
        } else {
            prove((status == HG_E_NUMERIC) && (self.newest == was) && (self.data[any] >= before[any]) && (self.data[any] <= before[any]), "nothing changed");
            reach("refused");
        }
        prove(hg_ring_open(&self) == &self.data[(size_t)self.newest * width], "a row to be filled");
        hg_ring_reset(&self);
        prove(self.newest == 0U, "forgotten");
    }
}

/** A part of a past row is overwritten, and nothing else; a lag beyond the ring is ignored.
 *  Any width and length up to WIDTH and LENGTH, any place, any lag.
 *  @proves hg_ring_rewrite
 *  @run check real=f32 unwind=10 limit=150 WIDTH=3U LENGTH=3U */
void proof_ring_rewrite(void)
{
    hg_real memory[WIDTH * LENGTH];
    hg_real part[WIDTH];
    const uint8_t width = any_u8_in(1U, WIDTH);
    const uint8_t length = any_u8_in(1U, LENGTH);
    hg_ring self = {.data = TAIL(memory, (size_t)width * length), .width = width, .length = length, .newest = any_u8_in(0U, (uint8_t)(length - 1U))};
    const uint8_t lag = any_u8();
    const uint8_t first = any_u8_in(0U, width);
    const uint8_t count = any_u8_in(0U, (uint8_t)(width - first));
    const size_t any = any_u8_in(0U, (uint8_t)((width * length) - 1U));
    assume(hg_real_finite(self.data[any]));
    const hg_real before = self.data[any];
    hg_ring_rewrite(&self, lag, first, count, TAIL(part, count));
    const size_t row = (size_t)((self.newest + length - (lag % length)) % length) * width;
    const bool inside = (lag < length) && (any >= (row + first)) && (any < (row + first + count));
    prove(inside || ((self.data[any] >= before) && (self.data[any] <= before)), "nothing but the part");
    if (inside) {
        reach("a place that is rewritten");
    }
}
