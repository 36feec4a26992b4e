using UnityEngine;

namespace Gsac.Samples
{
    /// <summary>The user's hands, whoever tracks them.</summary>
    public interface IGsacHands
    {
        /// <summary>The tip of an index finger in the world; false where it is not tracked now.</summary>
        bool TryTip(bool left, out Vector3 tip);
    }
}
