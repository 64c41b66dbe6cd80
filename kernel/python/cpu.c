/* Whether this processor and system run AVX2 and FMA code. Compiled for the base instruction set only. */
int tg_cpu_has_avx2(void);

int tg_cpu_has_avx2(void)
{
#if defined(__x86_64__) && defined(__GNUC__)
    __builtin_cpu_init();
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
    return 0;
#endif
}
