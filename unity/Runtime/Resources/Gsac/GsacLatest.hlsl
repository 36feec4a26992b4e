// Of the draws that a camera was asked for in one frame only the latest counts.
uint GsacNumber; // of this draw
StructuredBuffer<uint> GsacLatest; // 1: the draw that counts

// All corners in one place outside the view draw nothing.
float4 GsacIfLatest(float4 clip)
{
    return GsacLatest[0] == GsacNumber ? clip : float4(2, 2, 2, 1);
}
