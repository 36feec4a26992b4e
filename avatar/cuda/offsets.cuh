// Clothes and hair: a smooth displacement of the rest vertices (Nicolet et al. 2021), every few steps. The gradient smoothed once
// and twice over is a pair of series (smoothing.py) inside one kernel, with a barrier over its blocks.

constexpr int CLOSE = 8;  // neighbours whose numbers are kept in registers

struct Barrier {
    int *arrived, target;

    // All blocks of the launch fit on the GPU at once, so waiting for each other ends.
    __device__ void wait() {
        __syncthreads();
        target += gridDim.x;
        if (threadIdx.x == 0) {
            int seen;
            asm volatile("red.release.gpu.global.add.s32 [%0], 1;" ::"l"(arrived) : "memory");
            do asm volatile("ld.acquire.gpu.global.s32 %0, [%1];" : "=r"(seen) : "l"(arrived) : "memory");
            while (seen < target);
        }
        __syncthreads();
    }
};

struct Smoothed { Vec<float> once, twice; };

// This vertex's rows of S b and S S b, S = (I + lambda L)^-1: sums of T_k(t) b, t the matrix I + lambda L brought to -1..1.
FORMULA Smoothed smoothed(const Scene &s, Barrier &barrier, int v, Vec<float> b) {
    int begin = 0, end = 0, near[CLOSE];
    if (v < s.vertex_count) {
        begin = s.near_start[v];
        end = s.near_start[v + 1];
    }
    for (int e = 0; e < CLOSE; ++e) near[e] = begin + e < end ? s.near_vertex[begin + e] : -1;
    float own = (1 + s.smoothness * (end - begin) - s.series_middle) / s.series_half, beside = -s.smoothness / s.series_half;
    Vec<float> now = b, before = {0, 0, 0};
    Smoothed out = {b * s.series[0], b * s.series[1]};
    for (int k = 1; k < s.series_terms; ++k) {
        float4 *term = (float4 *)s.solve_step + size_t(k % 2) * s.vertex_count;
        if (v < s.vertex_count) __stcg(term + v, float4{now.x, now.y, now.z, 0});
        barrier.wait();
        Vec<float> sum = {0, 0, 0};
        float4 other[CLOSE];
        for (int e = 0; e < CLOSE; ++e) other[e] = near[e] < 0 ? float4{0, 0, 0, 0} : __ldcg(term + near[e]);
        for (int e = 0; e < CLOSE; ++e) sum = sum + Vec<float>{other[e].x, other[e].y, other[e].z};
        for (int e = begin + CLOSE; e < end; ++e) {
            float4 far = __ldcg(term + s.near_vertex[e]);
            sum = sum + Vec<float>{far.x, far.y, far.z};
        }
        Vec<float> next = (now * own + sum * beside) * (k == 1 ? 1.0f : 2.0f) - before;
        before = now;
        now = next;
        out.once = out.once + now * s.series[2 * k];
        out.twice = out.twice + now * s.series[2 * k + 1];
    }
    return out;
}

// (blocks of vertices), after the step's pose update: gathers the gradients at rest, and every few steps moves the offsets.
extern "C" __global__ void __launch_bounds__(256) offset_step(Scene s) {
    __shared__ float peaks[8];
    if (halted(s)) return;
    float rate = s.now[0].plan.offset;
    if (rate == 0) return;
    State &state = *s.state;
    int v = blockIdx.x * 256 + threadIdx.x, step = state.step - 1, every = s.offset_every;
    bool mine = v < s.vertex_count;
    Vec<float> sum = {0, 0, 0};
    if (mine) {
        for (int b = 0; b < s.batch; ++b) sum = sum + vec(s.grad_rest + 3 * (size_t(b) * s.vertex_count + v));
        sum = sum * (1.0f / s.batch);
        if (step % every) sum = sum + vec(s.gathered + 3 * v);
        s.gathered[3 * v] = sum.x;
        s.gathered[3 * v + 1] = sum.y;
        s.gathered[3 * v + 2] = sum.z;
    }
    if (step % every != every - 1) return;
    Barrier barrier = {&state.barrier, 0};
    Smoothed found = smoothed(s, barrier, v, sum * ((mine ? s.offset_share[v] : 0) / every));
    float peak = fmaxf(fabsf(found.once.x), fmaxf(fabsf(found.once.y), fabsf(found.once.z)));
    for (int stride = 16; stride > 0; stride /= 2) peak = fmaxf(peak, __shfl_xor_sync(~0u, peak, stride));
    if (threadIdx.x % 32 == 0) peaks[threadIdx.x / 32] = peak;
    __syncthreads();
    if (threadIdx.x == 0) {
        for (int w = 1; w < 8; ++w) peak = fmaxf(peak, peaks[w]);
        atomicMax(&state.peak, __float_as_int(peak));  // bits of positive floats sort as integers
    }
    float second = *s.offset_second;  // read on this side of the barrier: on the other one the first block writes it
    barrier.wait();
    peak = __int_as_float(*(volatile int *)&state.peak);
    float n = step / every + 1;
    second += 0.01f * (peak * peak - second);
    float scale = rate / (1 - powf(0.9f, n)) / (sqrtf(second / (1 - powf(0.99f, n))) + 1e-20f);
    if (mine) {
        float *kept = s.offset_first + 3 * v;  // Adam's first moment, smoothed once more: smoothing is linear
        Vec<float> first = vec(kept);
        first = first + (found.twice - first) * 0.1f;
        kept[0] = first.x;
        kept[1] = first.y;
        kept[2] = first.z;
        s.offset[3 * v] -= scale * first.x;
        s.offset[3 * v + 1] -= scale * first.y;
        s.offset[3 * v + 2] -= scale * first.z;
    }
    if (v == 0) *s.offset_second = second;
}
