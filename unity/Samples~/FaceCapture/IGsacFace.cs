namespace Gsac.Samples
{
    /// <summary>A face tracker, whatever makes it.</summary>
    public interface IGsacFace
    {
        /// <summary>names: ARKit's; weights: 0..1, to be filled where the tracker knows them. False where it sees no face now.</summary>
        bool TryRead(string[] names, float[] weights);
    }
}
