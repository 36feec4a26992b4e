using UnityEngine;

namespace Gsac.Samples
{
    /// <summary>Twenty people who take turns in the clips of their files, each begun at another time.</summary>
    [AddComponentMenu("Gsac/Samples/Gsac Crowd Of Twenty")]
    public sealed class GsacCrowdOfTwenty : MonoBehaviour
    {
        [SerializeField] GsacCast cast = null;
        [SerializeField, Tooltip("s between two people's beginnings")] float apart = 0.4f;

        float clock;
        int begun;

        void Update()
        {
            if (cast == null) return;
            clock += Time.deltaTime;
            while (begun < cast.Standing.Length && clock >= begun * apart) Begin(cast.Standing[begun], begun++);
        }

        static void Begin(GsacAvatar avatar, int number)
        {
            int n = 0, which = avatar.Data.Clips.Count == 0 ? -1 : number % avatar.Data.Clips.Count;
            foreach (string clip in avatar.Data.Clips.Keys)
            {
                if (n++ == which) avatar.PlayClip(clip);
            }
        }
    }
}
