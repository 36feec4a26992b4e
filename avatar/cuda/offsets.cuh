// Clothes and hair: a smooth displacement of the rest vertices (Nicolet et al. 2021), every few steps. The two solves with
// I + lambda L (L: the mesh's uniform Laplacian) are Chebyshev iterations inside one kernel, with a barrier over its blocks.

constexpr int ITERATIONS = 72;

struct Barrier {
    int *arrived, target;

    // All blocks of the launch fit on the GPU at once, so waiting for each other ends.
    __device__ void wait() {
        __syncthreads();
        target += gridDim.x;
        if (threadIdx.x == 0) {
            __threadfence();
            atomicAdd(arrived, 1);
            while (*(volatile int *)arrived < target) {}
            __threadfence();
        }
        __syncthreads();
    }
};

// This vertex's row of (I + lambda L)^-1 b; eigenvalues of the matrix over its diagonal lie in [least, 2].
FORMULA Vec<float> solve(const Scene &s, Barrier &barrier, int v, Vec<float> b, float least) {
    int begin = 0, end = 0;
    float inverse = 0;
    if (v < s.vertex_count) {
        begin = s.near_start[v];
        end = s.near_start[v + 1];
        inverse = 1 / (1 + s.smoothness * (end - begin));
    }
    float theta = (2 + least) / 2, delta = (2 - least) / 2, sigma = theta / delta, rho = 1 / sigma;
    Vec<float> x = {0, 0, 0}, r = b * inverse, d = r * (1 / theta);
    for (int i = 0; i < ITERATIONS; ++i) {
        float *step = s.solve_step + size_t(i % 2) * s.vertex_count * 3;
        if (v < s.vertex_count) {
            __stcg(step + 3 * v, d.x);
            __stcg(step + 3 * v + 1, d.y);
            __stcg(step + 3 * v + 2, d.z);
        }
        barrier.wait();
        Vec<float> sum = {0, 0, 0};
#pragma unroll 4
        for (int e = begin; e < end; ++e) {
            const float *from = step + 3 * s.near_vertex[e];
            sum = sum + Vec<float>{__ldcg(from), __ldcg(from + 1), __ldcg(from + 2)};
        }
        x = x + d;
        r = r - d + sum * (s.smoothness * inverse);
        float next = 1 / (2 * sigma - rho);
        d = d * (next * rho) + r * (2 * next / delta);
        rho = next;
    }
    return x + d;
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
    float least = 1 / (1 + s.smoothness * s.most_near);
    Vec<float> smooth = solve(s, barrier, v, sum * ((mine ? s.offset_share[v] : 0) / every), least);
    float peak = fmaxf(fabsf(smooth.x), fmaxf(fabsf(smooth.y), fabsf(smooth.z)));
    for (int stride = 16; stride > 0; stride /= 2) peak = fmaxf(peak, __shfl_xor_sync(~0u, peak, stride));
    if (threadIdx.x % 32 == 0) peaks[threadIdx.x / 32] = peak;
    __syncthreads();
    if (threadIdx.x == 0) {
        for (int w = 1; w < 8; ++w) peak = fmaxf(peak, peaks[w]);
        atomicMax(&state.peak, __float_as_int(peak));  // bits of positive floats sort as integers
    }
    barrier.wait();
    peak = __int_as_float(*(volatile int *)&state.peak);
    float n = step / every + 1, second = *s.offset_second;
    second += 0.01f * (peak * peak - second);
    float scale = 1 / (1 - powf(0.9f, n)) / (sqrtf(second / (1 - powf(0.99f, n))) + 1e-20f);
    Vec<float> first = {0, 0, 0};
    if (mine) {
        float *kept = s.offset_first + 3 * v;
        first = vec(kept);
        first = first + (smooth - first) * 0.1f;
        kept[0] = first.x;
        kept[1] = first.y;
        kept[2] = first.z;
    }
    Vec<float> move = solve(s, barrier, v, first * scale, least);
    if (mine) {
        s.offset[3 * v] -= rate * move.x;
        s.offset[3 * v + 1] -= rate * move.y;
        s.offset[3 * v + 2] -= rate * move.z;
    }
    if (v == 0) *s.offset_second = second;
}
