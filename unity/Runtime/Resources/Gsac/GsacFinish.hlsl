// What is done to an avatar's picture beyond its own colours and light: tint, fading, the scene's fog. A pass whose pipeline has fog says
// GSAC_FOGGED (a colour at a place in clip space).
#ifndef GSAC_FINISH_INCLUDED
#define GSAC_FINISH_INCLUDED

float4 GsacTint; // factor of the colours, how much of the person is there
uint GsacFog;    // 1: the scene's fog lies over the person

float3 GsacThroughFog(float3 colour, float4 clip)
{
#ifdef GSAC_FOGGED
    if (GsacFog) return GSAC_FOGGED(colour, clip);
#endif
    return colour;
}

// 0..1 by pixel, without a pattern that the eye follows: interleaved gradient noise (Jimenez 2014).
float GsacThreshold(float2 pixel)
{
    return frac(52.9829189 * frac(dot(floor(pixel), float2(0.06711056, 0.00583715))));
}

// A person who fades loses pixels, all layers of one at once: were the gaussians made fainter, her inside would shine through.
void GsacFade(float2 pixel)
{
    if (GsacTint.a < 1) clip(GsacTint.a - GsacThreshold(pixel) - 1e-4);
}

#endif
