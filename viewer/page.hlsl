// What viewer.html draws with WebGPU: the splats as Unity draws them, and the shadow on the floor.
#include "../unity/Runtime/Resources/Gsac/GsacDraw.hlsl"

float4 PageView0; // rows of world -> eye, x right, y up, -z ahead
float4 PageView1;
float4 PageView2;
float4 PageLens;  // 2 focal / size, -2 (px from the picture's middle to the axis) / size, y up
float4 PageDisc;  // place and radius of the shadow, m
float4 PageInk;   // size of the picture, px; strength of the shadow

// naga takes SPIR-V for Vulkan's and turns y over, so here it points down.
float4x4 PageProjection()
{
    return float4x4(PageLens.x, 0, PageLens.z, 0, 0, -PageLens.y, -PageLens.w, 0, 0, 0, -1, -2 * GSAC_NEAR, 0, 0, -1, 0);
}

float4x4 PageView()
{
    return float4x4(PageView0, PageView1, PageView2, float4(0, 0, 0, 1));
}

struct PageSplat
{
    float4 clip : SV_Position;
    float2 sigmas : TEXCOORD0;
    nointerpolation float4 colour : TEXCOORD1;
};

PageSplat SplatVertex(uint vertex : SV_VertexID)
{
    GsacCorner corner = GsacSplatCorner(vertex, PageView(), PageProjection(), PageInk.xy, float3(0, 0, 0));
    PageSplat output;
    output.clip = corner.clip;
    output.sigmas = corner.sigmas;
    output.colour = corner.colour;
    return output;
}

float4 SplatFragment(PageSplat input) : SV_Target
{
    return GsacPixel(input.sigmas, input.colour);
}

struct PageFloor
{
    float4 clip : SV_Position;
    float2 place : TEXCOORD0;
};

PageFloor FloorVertex(uint vertex : SV_VertexID)
{
    PageFloor output;
    output.place = float2((vertex & 1) ? 1.0 : -1.0, (vertex & 2) ? 1.0 : -1.0);
    float4 world = float4(PageDisc.x + output.place.x * PageDisc.w, PageDisc.y, PageDisc.z + output.place.y * PageDisc.w, 1);
    output.clip = mul(PageProjection(), mul(PageView(), world));
    return output;
}

float4 FloorFragment(PageFloor input) : SV_Target
{
    float soft = smoothstep(0, 1, 1 - length(input.place));
    return float4(0, 0, 0, PageInk.z * soft * soft);
}
