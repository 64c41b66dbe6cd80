/* libFuzzer: restoring from any bytes, and from a good snapshot with any words changed and a checksum that fits. Refused, or an estimator that
 * goes on and can be written again. */
#include "bytes.h"

static union {
    double aligned;
    uint8_t bytes[TG_ESTIMATOR_ROOM];
} room, snapshot;

static void drive(tg_estimator *e, double from, int rows)
{
    tg_estimate out;
    for (int row = 0; row < rows; row++) {
        tg_sample sample = sample_of(row);
        sample.time = from + 0.01 * row;
        tg_estimator_update(e, &sample, &out);
    }
}

static size_t changed_snapshot(bytes_left *b, unsigned kind)
{
    tg_estimator *const e = (tg_estimator *)&room;
    const tg_settings s = settings_of((int)(kind % METHODS));
    CHECK(tg_estimator_init(e, &s) == TG_OK, "init");
    drive(e, 0, 40);
    CHECK(tg_estimator_snapshot(e, snapshot.bytes) == TG_OK, "snapshot");
    const size_t size = tg_snapshot_size(e);
    while (b->left) {
        const size_t place = (65536u * byte_of(b) + 256u * byte_of(b) + byte_of(b)) % (size - 4);
        uint32_t word = 0;
        for (int k = 0; k < 4; k++) word = word << 8 | byte_of(b);
        memcpy(snapshot.bytes + place, &word, sizeof word);
    }
    seal_snapshot(snapshot.bytes, size);
    return size;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_left b = {data, size};
    tg_estimator *const e = (tg_estimator *)&room;
    check_state = 88172645463325252u;
    const unsigned kind = byte_of(&b);
    const size_t length = kind & 128 ? 0 : changed_snapshot(&b, kind);
    if (tg_estimator_restore(e, sizeof room, length ? snapshot.bytes : b.at, length ? length : b.left) != TG_OK) return 0;
    drive(e, 1, 20);
    drive(e, 1e6, 20);
    CHECK(tg_estimator_snapshot(e, snapshot.bytes) == TG_OK, "snapshot");
    return 0;
}
