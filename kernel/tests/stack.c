/* The stack of each call of an estimator, for controllers whose tasks have little: bytes below the caller's frame that no longer hold what
 * was painted there. Neither a start nor a restart may build a second estimator there. */
#include "driven.h"

enum { DEPTH = 1 << 18, ROWS = 60, PAINT = 0x5a };

static union {
    double aligned;
    uint8_t bytes[TG_ESTIMATOR_ROOM];
} object, other, snapshot;
static tg_estimator *const e = (tg_estimator *)(void *)&object;
static tg_settings settings;
static tg_sample sample;
static tg_estimate estimate;

static tg_status start(void) { return tg_estimator_init(e, &settings); }
static tg_status update(void) { return tg_estimator_update(e, &sample, &estimate); }
static tg_status keep(void) { return tg_estimator_snapshot(e, snapshot.bytes); }
static tg_status restore(void) { return tg_estimator_restore((tg_estimator *)(void *)&other, sizeof other, snapshot.bytes, tg_snapshot_size(e)); }

/* Paints what lies below the caller's frame, or tells how much of it was written since. */
static __attribute__((noinline)) size_t below(int paint)
{
    volatile uint8_t space[DEPTH];
    size_t untouched = 0;
    for (size_t k = 0; paint && k < DEPTH; k++) space[k] = PAINT;
    while (untouched < DEPTH && space[untouched] == PAINT) untouched++;
    return DEPTH - untouched;
}

static __attribute__((noinline)) size_t stack_of(tg_status (*call)(void))
{
    below(1);
    CHECK(call() == TG_OK, "a call failed");
    return below(0);
}

int main(void)
{
    for (int method = 0; method < METHODS; method++) {
        settings = settings_of(method);
        size_t updates = 0;
        const size_t starts = stack_of(start);
        for (int row = 0; row < ROWS; row++) {
            sample = sample_of(row);
            sample.time = 0.01 * row;
            const size_t now = stack_of(update);
            if (now > updates) updates = now;
        }
        const size_t keeps = stack_of(keep), restores = stack_of(restore), most = tg_estimator_size(TG_FIXED) / 2;
        printf("method %d, engine %d, policy %d: object %d bytes, snapshot %d; stack of init %d, update %d, snapshot %d, restore %d\n", (int)settings.method,
               (int)settings.tuning.engine, (int)settings.tuning.policy, (int)tg_estimator_size(settings.tuning.policy), (int)tg_snapshot_size(e),
               (int)starts, (int)updates, (int)keeps, (int)restores);
        CHECK(starts < most && restores < most, "an estimator on the stack");
    }
    return 0;
}
