// Lays the avatar's own picture over the scene, for a wrapper that brings the pipeline's projection and what lies behind.
#include "GsacDraw.hlsl"
#include "GsacFinish.hlsl"
#include "GsacLatest.hlsl"

#define GSAC_STAND_IN 8 // px: a texture that small is Unity's for one that is not there

float4 GsacEyeScreen;       // px of the picture; m from the eye at which it is laid over the scene, whether a copy of that may be used
float4 GsacEyeRect;         // clip x and y of the picture's lower left and upper right corner, y up
float4 GsacEyeLens;         // of the camera's own projection, y up: clip x and y of the eye's, what shifts them
Texture2D<float4> GsacTrained;     // display colour, premultiplied; alpha
Texture2D<float> GsacTrainedDepth; // mean depth, m, premultiplied
SamplerState GsacLinearClampSampler;

struct GsacLaidVaryings
{
    float4 clip : SV_Position;
    float2 place : TEXCOORD0;
    float2 side : TEXCOORD1; // m to the right and up: a metre ahead, or at any distance where all lines of sight run side by side
};

struct GsacLaidPixel
{
    float4 colour : SV_Target;
    float depth : SV_Depth;
};

// Clip space of what lies `depth` m ahead.
float4 GsacAhead(float2 side, float depth, float4x4 projection)
{
    return mul(projection, float4(GsacLensOf(projection).flat ? side : side * depth, -depth, 1));
}

// vertex: 4, the picture's corners.
GsacLaidVaryings GsacLaid(uint vertex, float4x4 projection)
{
    float2 place = float2((vertex & 1) ? 1.0 : 0.0, (vertex & 2) ? 1.0 : 0.0);
    float2 corner = lerp(GsacEyeRect.xy, GsacEyeRect.zw, place);
    GsacLaidVaryings output;
    output.side = (corner + GsacEyeLens.zw) / GsacEyeLens.xy;
    output.clip = GsacIfLatest(GsacAhead(output.side, GsacEyeScreen.z, projection));
    output.place = place;
    return output;
}

// behind: linear light of what lies there; size: px of the picture that it is from, a few where there is none.
GsacLaidPixel GsacLay(GsacLaidVaryings input, float4x4 projection, float3 behind, float2 size)
{
    GsacFade(input.clip.xy);
    float4 trained = GsacTrained.Sample(GsacLinearClampSampler, input.place);
    clip(trained.a - GsacBlend.z);
    GsacLaidPixel pixel;
    pixel.colour = GsacOver(trained, behind, size.x > GSAC_STAND_IN && GsacEyeScreen.w > 0.5);
    float depth = GsacTrainedDepth.Sample(GsacLinearClampSampler, input.place) / trained.a;
    float4 place = GsacAhead(input.side, depth, projection);
    pixel.depth = saturate(place.z / place.w);
    float alpha = max(pixel.colour.a, 1e-6);
    pixel.colour.rgb = alpha * GsacThroughFog(pixel.colour.rgb / alpha, place);
    return pixel;
}
