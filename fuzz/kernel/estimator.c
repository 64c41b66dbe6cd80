/* libFuzzer: an estimator of any method whose settings and samples may be anything. A status, never undefined behaviour; a refused sample
 * leaves the estimator as it was; with sound settings nothing that it gives is infinite, whatever is measured. */
#include "bytes.h"

static union {
    double aligned;
    uint8_t bytes[TG_ESTIMATOR_ROOM];
} room, before, other, snapshot;

/* Returns whether it changed any. */
static int change_settings(tg_settings *s, bytes_left *b)
{
    const tg_settings whole = *s;
    for (unsigned count = byte_of(b) % 8; count; count--) {
        const size_t place = 256u * byte_of(b) + byte_of(b), words = sizeof *s / sizeof(tg_real);
        const tg_real value = number(b);
        memcpy((uint8_t *)s + place % words * sizeof value, &value, sizeof value);
    }
    if (byte_of(b) & 1) s->machine.wheels = (int32_t)byte_of(b) - 8;
    if (byte_of(b) & 1) s->axles = (int32_t)byte_of(b) - 8, s->wheel_axle[byte_of(b) % 8] = (int32_t)byte_of(b) - 8;
    return memcmp(s, &whole, sizeof whole) != 0;
}

static void one_sample(tg_estimator *e, bytes_left *b, double *time, int row, int sound)
{
    tg_sample sample = sample_of(row);
    tg_estimate out;
    const size_t size = tg_estimator_size(methods[0][1]);
    const unsigned kind = byte_of(b);
    for (unsigned count = kind % 8; count; count--) sample.value[byte_of(b) % TG_SLOTS] = number(b);
    sample.time = *time + (kind & 64 ? (double)number(b) : 0.01 * (kind >> 3 & 7));
    memcpy(&before, e, size);
    const tg_status status = tg_estimator_update(e, &sample, &out);
    if (status != TG_OK) CHECK(memcmp(e, &before, size) == 0, "a refused sample changed the estimator");
    else {
        *time = sample.time;
        for (int k = 0; k < TG_OUT_SLOTS; k++) CHECK(!sound || !isinf((double)out.value[k]), "slot %d is infinite", k);
    }
    if (kind & 128) {
        CHECK(tg_estimator_snapshot(e, snapshot.bytes) == TG_OK, "snapshot");
        CHECK(tg_estimator_restore((tg_estimator *)&other, sizeof other, snapshot.bytes, tg_snapshot_size(e)) == TG_OK, "its own snapshot");
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_left b = {data, size};
    tg_estimator *const e = (tg_estimator *)&room;
    double time = 0;
    check_state = 88172645463325252u;
    tg_settings s = settings_of((int)(byte_of(&b) % METHODS));
    const int sound = !change_settings(&s, &b);
    memset(&room, 0, sizeof room);
    if (tg_estimator_init(e, &s) != TG_OK) return 0;
    for (int row = 15; row < 140 && b.left; row++) one_sample(e, &b, &time, row, sound);
    return 0;
}
